"""How each service is put together for a process of its own; one module a service, imported only by that process."""
