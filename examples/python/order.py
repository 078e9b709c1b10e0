#!/usr/bin/env python3
"""Gives an order and prints what came of it:

order.py formation wedge 1.5 | goto mag1 1 2 | stop [mag1] | estop | reset      (CONVOY_ROS=HOST:PORT)
"""
import os
import sys

import roslibpy

FIELDS = {"formation": ["kind", "spacing"], "goto": ["robot", "x", "y"], "stop": ["robot"], "estop": [], "reset": []}


def value(text):
    try:
        return float(text)
    except ValueError:
        return text


def main(order, *words):
    host, port = os.environ.get("CONVOY_ROS", "127.0.0.1:9090").split(":")
    ros = roslibpy.Ros(host=host, port=int(port))
    ros.run()
    request = dict(zip(FIELDS[order], map(value, words)))
    service = roslibpy.Service(ros, f"/{order}", "")
    answer = service.call(roslibpy.ServiceRequest(request), timeout=5)
    print(answer["message"])
    ros.terminate()
    return 0 if answer["success"] else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
