"""A driving stack with rospy alone: /route, /odom, /clock in, /cmd_vel out."""

import math
import threading

import rospy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry, Path
from pursuit import Pursuit
from rosgraph_msgs.msg import Clock


class Stack:
    def __init__(self):
        self.route, self.pose, self.clock, self.driver = None, None, None, Pursuit()
        self.lock = threading.Lock()
        self.answers = rospy.Publisher("/cmd_vel", TwistStamped, queue_size=10, tcp_nodelay=True)
        for name, kind in (("route", Path), ("odom", Odometry), ("clock", Clock)):
            rospy.Subscriber(f"/{name}", kind, getattr(self, f"on_{name}"), tcp_nodelay=True)

    def on_route(self, path):
        places = [(each.pose.position.x, each.pose.position.y) for each in path.poses]
        with self.lock:
            if places != self.route:
                self.route, self.driver = places, Pursuit()

    def on_odom(self, pose):
        with self.lock:
            self.pose = pose
            self.answer()

    def on_clock(self, clock):
        with self.lock:
            self.clock = clock.clock
            self.answer()

    def answer(self):
        """Answer a moment once both topics have it; they have no order."""
        if self.route is None or self.pose is None or self.pose.header.stamp != self.clock:
            return
        at, turn, speed = self.pose.pose.pose.position, self.pose.pose.pose.orientation, self.pose.twist.twist.linear.x
        steering, wanted = self.driver.command(at.x, at.y, 2.0 * math.atan2(turn.z, turn.w), speed, self.route)
        told = TwistStamped()
        told.header.stamp = self.clock
        told.twist.linear.x, told.twist.angular.z = wanted, wanted * math.tan(steering) / 2.7
        self.answers.publish(told)


rospy.init_node("stack", disable_rostime=True)
Stack()
rospy.spin()
