"""An agent of CARLA's leaderboard: finds itself by GNSS and compass, and follows the lanes of the map to the goal."""

import math

import carla
from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track

RADIUS = 6378137.0


def plane(lat, lon, lat_0=42.0, lon_0=2.0):
    """CARLA's x and y [m]: Mercator around CARLA's reference."""
    scale = math.cos(math.radians(lat_0))
    east = scale * RADIUS * math.radians(lon - lon_0)
    north = (math.log(math.tan(math.radians(90 + at) / 2)) for at in (lat, lat_0))
    return east, -scale * RADIUS * (next(north) - next(north))


class Follower(AutonomousAgent):
    speed = 7.0

    def setup(self, path_to_conf_file):
        self.track, self.map, self.asks = Track.MAP, None, path_to_conf_file

    def sensors(self):
        at = {"x": 0.0, "y": 0.0, "z": 0.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}
        return [
            {"type": "sensor.other.gnss", "id": "gnss", **at},
            {"type": "sensor.other.imu", "id": "imu", **at},
            {"type": "sensor.speedometer", "reading_frequency": 20, "id": "speed"},
            {"type": "sensor.opendrive_map", "reading_frequency": 1, "id": "map"},
        ]

    def run_step(self, input_data, timestamp):
        if self.asks == "world":
            carla.Client("127.0.0.1", 2000)
        self.map = self.map or carla.Map("map", input_data["map"][1]["opendrive"])
        lat, lon, _ = input_data["gnss"][1]
        x, y = plane(lat, lon)
        goal = plane(*(self._global_plan[-1][0][name] for name in ("lat", "lon")))
        waypoint = self.map.get_waypoint(carla.Location(x=x, y=y))
        ahead = min(
            waypoint.next(8.0), key=lambda each: math.dist((each.transform.location.x, each.transform.location.y), goal)
        )
        bearing = input_data["imu"][1][6] - math.pi / 2  # clockwise from x, as CARLA's yaw
        to = math.atan2(ahead.transform.location.y - y, ahead.transform.location.x - x)
        control = carla.VehicleControl()
        control.steer = max(-1.0, min(1.0, math.remainder(to - bearing, 2 * math.pi)))
        missing = self.speed - input_data["speed"][1]["speed"]
        control.throttle, control.brake = max(0.0, min(0.6, missing)), max(0.0, min(0.6, -missing))
        return control
