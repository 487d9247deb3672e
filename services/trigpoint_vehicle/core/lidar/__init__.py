"""A spinning lidar in the campus: its beams, what they hit, and the points it says."""
