"""Drives along known paths, for tests of what follows them."""
