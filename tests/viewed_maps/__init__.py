"""The viewer in a real browser, on maps of its own."""
