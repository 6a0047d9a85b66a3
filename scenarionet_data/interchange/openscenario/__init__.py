"""OpenSCENARIO XML 1.2 or 1.3: one file a scenario, beside the OpenDRIVE file of its map."""
