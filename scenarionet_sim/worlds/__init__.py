"""Recordings as arrays, side by side on a batch, and the state of everything that moves at one moment."""
