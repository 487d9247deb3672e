"""The event log: append-only MCAP streams with one writer each, the only truth, and its twin in memory."""
