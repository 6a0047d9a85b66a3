"""Units of conversion work and the properties of raw input."""
