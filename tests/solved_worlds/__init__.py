"""Small worlds with landmarks whose truth is known, for tests of the whole solve."""
