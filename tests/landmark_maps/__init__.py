"""Hand-made map versions, for the tests of the landmark database."""
