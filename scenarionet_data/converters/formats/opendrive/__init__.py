"""OpenDRIVE 1.4 to 1.8: ``curves`` (reference lines, polynomials), ``roads`` (roads, sections, lanes), ``reader``."""
