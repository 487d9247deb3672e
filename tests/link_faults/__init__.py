"""A vehicle and a fleet in processes of their own, with a link between them that can be cut, and either end stopped."""
