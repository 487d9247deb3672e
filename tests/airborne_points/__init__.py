"""Airborne lidar of the French IGN, classified, as the tiles service would gather it."""
