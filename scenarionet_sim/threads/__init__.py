"""Threads that take items from each other inside compiled functions."""
