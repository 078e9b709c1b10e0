#!/usr/bin/env python3
"""A controller of your own for one robot of a fleet, ten times a second: controller.py ROBOT [SECONDS] [HOST:PORT]

It drives ahead and turns away from what its sonars or its lidar hear. The robot's own limits, its avoidance of contacts and every
stop stay in force: what is said here is a wish.
"""
import math
import sys
import time

import roslibpy

PERIOD_S = 0.1
NEAR_M = 1.0


class Controller:
    """Yours to change: what was heard last, and what to do about it."""

    def __init__(self):
        self.odom = None
        self.scan = None

    def step(self):
        """Speed in m/s and turn in rad/s; None while nothing is known."""
        if self.odom is None or self.scan is None:
            return None

        nearest, bearing = math.inf, 0.0
        for n, distance in enumerate(self.scan["ranges"]):
            angle = self.scan["angle_min"] + n * self.scan["angle_increment"]
            if distance is not None and abs(angle) < math.pi / 3 and distance < nearest:
                nearest, bearing = distance, angle

        if nearest < NEAR_M:
            return 0.0, -0.6 if bearing > 0 else 0.6
        return 0.25, 0.0


def main(robot, seconds="10", server="127.0.0.1:9090"):
    host, port = server.split(":")
    ros = roslibpy.Ros(host=host, port=int(port))
    ros.run()
    controller = Controller()

    def odom(message):
        controller.odom = message

    def scan(message):
        controller.scan = message

    roslibpy.Topic(ros, f"/{robot}/odom", "nav_msgs/Odometry").subscribe(odom)
    roslibpy.Topic(ros, f"/{robot}/scan", "sensor_msgs/LaserScan").subscribe(scan)
    wheels = roslibpy.Topic(ros, f"/{robot}/cmd_vel", "geometry_msgs/Twist")

    begun = time.monotonic()
    due, words, late = begun, 0, 0.0
    while ros.is_connected and time.monotonic() - begun < float(seconds):
        wish = controller.step()
        if wish is not None:
            speed, turn = wish
            wheels.publish(roslibpy.Message({"linear": {"x": speed}, "angular": {"z": turn}}))
            words += 1
        due += PERIOD_S
        late = max(late, time.monotonic() - due)
        time.sleep(max(due - time.monotonic(), 0))

    place = controller.odom and controller.odom["pose"]["pose"]["position"]
    print(f"{words} words, the latest {max(late, 0) * 1000:.0f} ms late; at {place['x']:.2f}, {place['y']:.2f} m" if place else "nothing was heard")
    ros.terminate()


if __name__ == "__main__":
    main(*sys.argv[1:])
