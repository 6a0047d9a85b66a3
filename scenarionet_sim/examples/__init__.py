"""Small complete programs with the environments."""
