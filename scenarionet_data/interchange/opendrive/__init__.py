"""OpenDRIVE (ASAM): roads, lanes and junctions in XML."""
