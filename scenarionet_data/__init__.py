"""Traffic scenarios as data: typed arrays, converters, the lake, its queries and its loader."""
