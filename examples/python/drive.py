#!/usr/bin/env python3
"""Drives a robot: drive.py ROBOT SPEED TURN [SECONDS] [HOST:PORT], in m/s and rad/s.

Each word lasts half a second, so it is said ten times a second; when this program ends, however it ends, the robot stands.
"""
import sys
import time

import roslibpy


def main(robot, speed, turn, seconds="2", server="127.0.0.1:9090"):
    host, port = server.split(":")
    ros = roslibpy.Ros(host=host, port=int(port))
    ros.run()
    wheels = roslibpy.Topic(ros, f"/{robot}/cmd_vel", "geometry_msgs/Twist")
    word = {"linear": {"x": float(speed), "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": float(turn)}}
    ends = time.monotonic() + float(seconds)

    while ros.is_connected and time.monotonic() < ends:
        wheels.publish(roslibpy.Message(word))
        time.sleep(0.1)

    ros.terminate()


if __name__ == "__main__":
    main(*sys.argv[1:])
