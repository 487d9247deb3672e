"""Pieces of work for the processes of a Dask cluster."""
