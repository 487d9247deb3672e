"""Labels and what is known of the landmarks they may be of."""
