#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A whole SLAM behind mobilia's pipe, with nothing but the standard library.

It believes the wheels and marks the cells in which beams ended: a start, in any language. Its
protocol is described in docs/bring_your_own.md. Standard output belongs to the protocol.
"""

import json
import math
import sys

CELL_M = 0.1


def between(a, b):
    """Pose b as seen from pose a; poses are x m, y m, theta rad."""
    dx, dy, c, s = b[0] - a[0], b[1] - a[1], math.cos(a[2]), math.sin(a[2])
    return [c * dx + s * dy, c * dy - s * dx, math.remainder(b[2] - a[2], 2.0 * math.pi)]


def compose(a, b):
    """Pose b, given in the frame of pose a, in the frame of a's parent."""
    c, s = math.cos(a[2]), math.sin(a[2])
    return [a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2]]


class Slam:
    def __init__(self):
        self.first, self.laser, self.hits = None, None, set()

    def frame(self, message):
        wheels = message["odometry"]["T_odom_robot"]
        self.first = self.first or wheels
        pose = between(self.first, wheels)  # the map frame is the robot's first pose
        self.laser = message.get("laser", self.laser)  # told once, and again when it changes
        if "ranges" in message:
            self.mark(compose(pose, self.laser["T_robot_laser"]), message["ranges"])
        return {"type": "estimate", "stamp_ns": message["stamp_ns"], "T_map_robot": pose}

    def mark(self, place, ranges):
        start, step = self.laser["angle_min"] + place[2], self.laser["angle_increment"]
        for beam, reach in enumerate(ranges):
            if 0.0 < reach <= self.laser["range_max"]:  # -1 is no return, -2 an error
                angle = start + beam * step
                x, y = place[0] + reach * math.cos(angle), place[1] + reach * math.sin(angle)
                self.hits.add((math.floor(y / CELL_M), math.floor(x / CELL_M)))

    def map(self):
        if not self.hits:
            return {"type": "map"}
        rows, columns = ([cell[k] for cell in self.hits] for k in (0, 1))
        low, left = min(rows), min(columns)
        height, width = max(rows) - low + 1, max(columns) - left + 1
        values = [-1] * (width * height)  # unknown
        for row, column in self.hits:
            values[(row - low) * width + column - left] = 1
        return {"type": "map", "width": width, "height": height, "resolution_m": CELL_M,
                "T_map_origin": [left * CELL_M, low * CELL_M, 0.0], "values": values}  # fmt: skip


slam = Slam()
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "hello":
        answer = {"type": "hello", "protocol": "mobilia-slam", "version": 1, "map": True}
    elif message["type"] == "frame":
        answer = slam.frame(message)
    elif message["type"] == "map":
        answer = slam.map()
    elif message["type"] == "reset":
        slam, answer = Slam(), {"type": "reset"}
    else:  # bye
        break
    print(json.dumps(answer), flush=True)
