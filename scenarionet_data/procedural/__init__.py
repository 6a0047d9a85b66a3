"""Procedural generator: road blocks joined into maps, and traffic on them.

In reading order: ``generate`` (a seed to an episode), ``options``; the map: ``path``, ``roadmap``, ``sections``,
``bottlenecks``, ``plazas``, ``intersection``, ``roundabout``; its lane graph: ``graph``; vehicles and road works:
``population``; the compiled time loop: ``drive``, with ``vehicles``, ``following``, ``lane_change``, ``right_of_way``.
Of version 2: ``sidewalks``, ``parking``, ``walking``, and the time loop ``flow``.
"""
