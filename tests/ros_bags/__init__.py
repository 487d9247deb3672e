"""ROS bags to test with, of either version, with clouds as common drivers lay them out."""
