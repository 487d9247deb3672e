"""The HTTP service beside tipg: the same database, the same requests, the same generator, in the same run."""
