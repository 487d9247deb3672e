"""Positions, poses and their uncertainty, and the one place where frames are changed into one another."""
