"""Map versions made up for tests, near a simulated truth."""
