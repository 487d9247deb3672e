"""Sessions of each bus that hear one another, and what tests send between them."""
