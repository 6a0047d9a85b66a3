"""Small whole programs over the environments, to read, run and copy from."""
