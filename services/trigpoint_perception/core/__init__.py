"""Perception as functions of sweeps: no log, no clock, no chance."""
