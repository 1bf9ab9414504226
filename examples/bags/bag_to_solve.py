#!/usr/bin/env python3
"""Reads detections and camera info from a bag and prints lines for `tanker_pose solve`.

    python3 examples/bags/bag_to_solve.py approach | target/release/tanker_pose solve --marker-map paper

Needs rosbags (from pip), but no ROS. Reads MCAP and SQLite, as `ros2 bag record` writes them.
"""

import json
import sys
from pathlib import Path

from rosbags.highlevel import AnyReader
from tanker_types import typestore

TOPICS = {"/camera_info", "/feature_points"}

camera = None
with AnyReader([Path(sys.argv[1])], default_typestore=typestore()) as bag:
    connections = [c for c in bag.connections if c.topic in TOPICS]
    for connection, _, raw in bag.messages(connections=connections):
        message = bag.deserialize(raw, connection.msgtype)
        if connection.topic == "/camera_info":
            camera = {
                "width": message.width,
                "height": message.height,
                "distortion_model": message.distortion_model,
                "d": message.d.tolist(),
                "k": message.k.tolist(),
                "p": message.p.tolist(),
            }
        elif camera is None:
            print("no camera info before the first detections", file=sys.stderr)
        else:
            stamp = message.header.stamp
            points = [{"id": p.id, "u": p.u, "v": p.v, "sigma": p.sigma} for p in message.points]
            frame = {"id": f"{stamp.sec}.{stamp.nanosec:09d}", "camera": camera, "points": points}
            print(json.dumps(frame))
