"""Search of a logical scenario's parameters for the border at which a policy begins to fail."""
