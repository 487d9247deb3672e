"""Load for ingest: vehicles that send as fast as they are acknowledged, and a bare subscriber to compare with."""
