"""Packs: databases with everything that belongs to their members, to carry elsewhere."""
