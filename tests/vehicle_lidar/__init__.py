"""Worlds for the simulated lidar: short drives with exact sensors."""
