"""Files of a lake, in a local folder or in an object store."""
