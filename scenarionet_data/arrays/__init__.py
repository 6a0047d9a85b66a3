"""Arrays of numbers: dtypes, ragged arrays, plane geometry, and how loops are compiled."""
