"""Events to test with: one of each class, any of each class, and whether two are the same."""
