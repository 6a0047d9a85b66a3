"""One verb a file; each file has a ``command``."""
