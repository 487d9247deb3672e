"""The command run in this process, and a campus small enough to run it on."""
