"""Backends: how driven vehicles move. One protocol, one behaviour suite; each backend is one file."""
