"""The `trigpoint` command: composes the services, in one process, and says what came of it.

Reads: (nothing)
Writes: (nothing)
"""
