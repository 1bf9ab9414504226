#!/usr/bin/env python3
"""Plays a bag into a running ROS 2 graph, as `ros2 bag play` does where ROS 2 is installed.

    python -m harness.play_bag BAG [--rate 2.0] [--delay 1.0] [--topics /camera_info ...]

Run it from `tests/` with the Python of `.venv`, or as a file: `tests/harness/play_bag.py`. Messages
are published as the bytes that the bag holds, at the pace at which they were recorded.
"""

import argparse
import importlib
import sys
import time
from pathlib import Path

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import rclpy
from rosbags.highlevel import AnyReader

from harness.peer import BEST_EFFORT
from harness.typestore import typestore


def message_class(ros_name: str) -> type:
    """The generated Python class of `package/msg/Name`."""
    package, kind, name = ros_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def play(bag: Path, rate: float, delay_s: float, topics: list[str] | None) -> int:
    """Publishes the bag's messages and returns how many."""
    rclpy.init()
    node = rclpy.create_node("play_bag")
    sent = 0
    with AnyReader([bag], default_typestore=typestore()) as reader:
        connections = [c for c in reader.connections if topics is None or c.topic in topics]
        publishers = {
            c.topic: node.create_publisher(message_class(c.msgtype), c.topic, BEST_EFFORT)
            for c in connections
        }
        # rclpy knows when it has found a subscriber, not when the subscriber has found it: like
        # `ros2 bag play --delay`.
        time.sleep(delay_s)
        begin = time.monotonic()
        first_ns = None
        for connection, time_ns, raw in reader.messages(connections=connections):
            first_ns = time_ns if first_ns is None else first_ns
            due = begin + (time_ns - first_ns) / 1e9 / rate
            time.sleep(max(0.0, due - time.monotonic()))
            if not rclpy.ok():
                break
            publishers[connection.topic].publish(bytes(raw))
            sent += 1
    node.destroy_node()
    rclpy.try_shutdown()
    return sent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bag", type=Path, help="a bag's directory, or a bare .mcap file")
    parser.add_argument("--rate", type=float, default=1.0, help="times the recorded pace")
    parser.add_argument(
        "--delay", type=float, default=1.0, help="seconds to be found before it starts"
    )
    parser.add_argument("--topics", nargs="+", help="play only these")
    arguments = parser.parse_args()
    if not arguments.bag.exists():
        parser.error(f"there is no bag at {arguments.bag}")
    if not arguments.rate > 0.0:
        parser.error(f"the rate must be positive, got {arguments.rate}")
    sent = play(arguments.bag, arguments.rate, arguments.delay, arguments.topics)
    print(f"played {sent} messages")


if __name__ == "__main__":
    main()
