"""Episodes as arrays: how they are simulated in batches, recorded and stored."""
