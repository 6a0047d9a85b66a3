"""The paper's experiments: which drivers are compared, on what, and what follows from the numbers."""
