"""SUMO (https://sumo.dlr.de): nets of edges and lanes, routes, and recorded motion in the form of its FCD output."""
