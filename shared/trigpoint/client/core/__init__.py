"""What a client works out from landmarks it holds: pure functions of their arguments."""
