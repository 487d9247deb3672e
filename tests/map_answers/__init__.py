"""A map that answers over a bus, for tests and figures of its clients."""
