"""Readers of raw file formats that several datasets share."""
