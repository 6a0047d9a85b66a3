"""Recordings as arrays, side by side on a stage, and the state of everything that moves at one moment."""
