"""A Dask cluster of processes on loopback, and pieces of work for it."""
