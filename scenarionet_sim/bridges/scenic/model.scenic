"""Model of Scenic's driving domain for this simulator: cars are driven by steering and throttle, all others by velocity."""

from scenarionet_sim.bridges.scenic.simulator import ScenarioNetSimulator

from scenic.domains.driving.model import *

simulator ScenarioNetSimulator(globalParameters.map)

class Simulated(DrivingObject):
    throttle: 0
    steer: 0
    brake: 0
    hand_brake: False

    def setPosition(self, pos, elevation):
        self.given_position = pos

    def setVelocity(self, vel):
        self.given_velocity = vel

    def setThrottle(self, throttle):
        self.throttle = throttle

    def setSteering(self, steering):
        self.steer = steering

    def setBraking(self, braking):
        self.brake = braking

    def setHandbrake(self, handbrake):
        self.hand_brake = handbrake

    def setReverse(self, reverse):
        if reverse:
            raise RuntimeError("cars of this simulator have no reverse gear")

class Vehicle(Vehicle, Simulated):
    pass

class Car(Vehicle, Steers):
    @property
    def isCar(self):
        return True

class Pedestrian(Pedestrian, Simulated, Walks):
    walking_heading: None
    walking_speed: None

    def setWalkingDirection(self, heading):
        self.walking_heading = heading

    def setWalkingSpeed(self, speed):
        self.walking_speed = speed
