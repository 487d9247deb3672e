"""A short drive of a lidar in a log, replayed as a fleet of any size."""
