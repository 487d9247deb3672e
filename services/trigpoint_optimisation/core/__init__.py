"""Association, factor graph and robust solve: functions of their arguments; gtsam's one home."""
