"""The filter: motion model, unscented update, initialisation, gate and re-acquisition; no input or output."""
