"""Measures of a map, as functions of their arguments."""
