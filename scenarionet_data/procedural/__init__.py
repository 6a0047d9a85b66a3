"""The procedural generator: road blocks joined into maps, and the traffic that drives on them.

In reading order: ``generate`` (a seed to an episode), ``options``; the map: ``path``, ``roadmap``, ``sections``,
``blocks``, ``intersection``, ``roundabout``, ``assemble``; what traffic needs of it: ``graph``, ``conflicts``,
``routes``; what is on it: ``construction``, ``population``, ``signals``; the compiled time loop: ``drive``, with
``vehicles``, ``following``, ``idm``, ``lane_change``, ``right_of_way``, ``jit``.
"""
