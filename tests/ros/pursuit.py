"""A driver without anything of ours: pure pursuit along a route at the speed that it began with."""

import math


class Pursuit:
    def __init__(self):
        self.speed = None

    def command(self, x, y, heading, speed, route):
        """Steering angle [rad] and speed [m/s] for a pose and a route, a list of x, y [m]."""
        if self.speed is None:
            self.speed = max(speed, 3.0)
        reach = 3.0 + 0.5 * self.speed
        nearest = min(range(len(route)), key=lambda k: (route[k][0] - x) ** 2 + (route[k][1] - y) ** 2)
        ahead = next((p for p in route[nearest:] if math.hypot(p[0] - x, p[1] - y) >= reach), None)
        if ahead is None:
            return 0.0, self.speed
        dx, dy = ahead[0] - x, ahead[1] - y
        across = -math.sin(heading) * dx + math.cos(heading) * dy
        return math.atan(2.7 * 2.0 * across / (dx * dx + dy * dy)), self.speed
