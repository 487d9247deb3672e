"""Real databases for tests and figures of the landmark map."""
