"""What perception finds along a simulated street, held against what stands there."""
