"""How scenarios become files and snapshots: written under temporary names, published whole, committed at once."""
