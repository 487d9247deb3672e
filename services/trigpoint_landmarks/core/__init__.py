"""Map versions from events, and answers about the map: pure functions."""
