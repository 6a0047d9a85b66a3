"""The procedural generator: road blocks joined into maps, and the traffic that drives on them."""
