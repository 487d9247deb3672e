"""One of each question to the map, of each answer and of each notice."""
