"""Files and snapshots of a lake: written under temporary names, published whole, committed atomically."""
