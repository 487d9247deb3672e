"""Answers over the bus: the newest map version from memory, all else from the store and the log."""
