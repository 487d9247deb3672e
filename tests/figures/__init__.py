"""The figures the project promises, each measured through the command a user would type."""
