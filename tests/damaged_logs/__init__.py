"""Logs made to be damaged, and the damage: seeded, so that each case can be made again."""
