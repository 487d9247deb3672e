"""Simulated drives taken live: what becomes of the map, and how long each step takes."""
