#!/usr/bin/env python3
"""Prints where the robots of a fleet are and why they do what they do: watch.py [SECONDS] [HOST:PORT]"""
import math
import sys
import time

import roslibpy


def main(seconds=10.0, server="127.0.0.1:9090"):
    host, port = server.split(":")
    ros = roslibpy.Ros(host=host, port=int(port))
    ros.run()

    def moved(message):
        for at in message["transforms"]:
            place, turn = at["transform"]["translation"], at["transform"]["rotation"]
            heading = math.degrees(2 * math.atan2(turn["z"], turn["w"]))
            print(f"{at['child_frame_id']}: {place['x']:.2f}, {place['y']:.2f} m, {heading:.0f} degrees")

    def line(message):
        print(f"{message['name']}: {message['msg']}")

    roslibpy.Topic(ros, "/tf", "tf2_msgs/TFMessage", throttle_rate=1000).subscribe(moved)
    roslibpy.Topic(ros, "/rosout", "rosgraph_msgs/Log").subscribe(line)

    def explained(robot):
        return lambda message: print(f"{robot}: {message['data']}")

    for topic in ros.get_topics():
        if topic.endswith("/why"):
            why = roslibpy.Topic(ros, topic, "std_msgs/String", throttle_rate=2000)
            why.subscribe(explained(topic.split("/")[1]))

    time.sleep(seconds)
    ros.terminate()


if __name__ == "__main__":
    main(*[float(word) if n == 0 else word for n, word in enumerate(sys.argv[1:3])])
