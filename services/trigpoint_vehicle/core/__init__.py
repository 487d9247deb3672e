"""The campus simulator and the readings of recorded data, as functions of their arguments."""
