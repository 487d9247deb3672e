"""What places points on a grid, gathers them there, and measures where an image lies beside them: pure functions."""
