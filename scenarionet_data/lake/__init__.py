"""The handles ``Lake`` and ``Database``."""
