"""A whole fleet at work in processes of its own: drives replayed into it, services killed, what is left compared."""
