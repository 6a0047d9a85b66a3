"""One scenario as frozen, typed arrays, with its vocabulary and validation."""
