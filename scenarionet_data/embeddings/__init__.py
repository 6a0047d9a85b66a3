"""Embeddings: a vector for each scenario as a user column, and the scenarios that lie near each other by it."""
