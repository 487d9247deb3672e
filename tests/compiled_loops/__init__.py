"""Every loop that is compiled when it is first called, called before tests need it."""
