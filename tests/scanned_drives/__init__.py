"""Drives with a lidar over ground that is known, and the logs they leave."""
