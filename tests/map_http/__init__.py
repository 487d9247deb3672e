"""The HTTP service asked in this process and in one of its own, with a log that is only in memory."""
