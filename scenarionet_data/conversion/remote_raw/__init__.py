"""Raw recordings in an object store: listing, download and temporary folders."""
