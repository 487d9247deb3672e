"""Drives around a block that know again where they were."""
