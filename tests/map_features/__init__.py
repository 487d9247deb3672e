"""Maps with something in every layer, in every database features are asked of, and tiles read back."""
