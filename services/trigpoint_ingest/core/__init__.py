"""What may enter the log, in which order, and once: functions of their arguments."""
