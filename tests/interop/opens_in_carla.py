"""Open OpenDRIVE files with CARLA's client, which needs no server for it; print how many have waypoints."""

import sys
from pathlib import Path

import carla

opened = 0
for name in sys.argv[1:]:
    road_map = carla.Map("exported", Path(name).read_text("utf-8"))
    opened += bool(road_map.generate_waypoints(5.0))
print(opened)
