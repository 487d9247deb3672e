"""What a running service shows of itself: numbers, health, logs and traces."""
