#!/usr/bin/env python3
"""Plays a bag into the ROS graph, as `ros2 bag play` does where ROS 2 is installed.

    python3 examples/bags/play_bag.py approach --topics /camera_info /feature_points
    python3 examples/bags/play_bag.py approach --rate 2.0 --delay 1.0 --ros-args -r __ns:=/receiver

Needs rosbags, rclpy and the messages of tanker_pose. Messages are published as the bytes that the bag holds, at the
pace at which they were recorded.
"""

import argparse
import importlib
import sys
import time
from pathlib import Path

import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from tanker_types import typestore

# The node's inputs are best effort. More than enough for a pause of the reader.
QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


def message_class(ros_name: str) -> type:
    """The generated Python class of `package/msg/Name`."""
    package, kind, name = ros_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def play(arguments: argparse.Namespace) -> int:
    """Publishes the bag's messages and returns how many."""
    node = rclpy.create_node("play_bag")
    clock = node.create_publisher(Clock, "/clock", QOS) if arguments.clock else None
    wanted = arguments.topics
    sent = 0
    with AnyReader([arguments.bag], default_typestore=typestore()) as reader:
        connections = [c for c in reader.connections if wanted is None or c.topic in wanted]
        publishers = {
            c.topic: node.create_publisher(message_class(c.msgtype), c.topic, QOS) for c in connections
        }
        # rclpy knows when it has found a subscriber, not when the subscriber has found it: like
        # `ros2 bag play --delay`.
        time.sleep(arguments.delay)
        begin = time.monotonic()
        first_ns = None
        for connection, time_ns, raw in reader.messages(connections=connections):
            first_ns = time_ns if first_ns is None else first_ns
            due = begin + (time_ns - first_ns) / 1e9 / arguments.rate
            time.sleep(max(0.0, due - time.monotonic()))
            if not rclpy.ok():
                break
            if clock is not None:
                now = Clock()
                now.clock.sec, now.clock.nanosec = divmod(time_ns, 1_000_000_000)
                clock.publish(now)
            publishers[connection.topic].publish(bytes(raw))
            sent += 1
    node.destroy_node()
    return sent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bag", type=Path, help="a bag's directory, or a bare .mcap file")
    parser.add_argument("--rate", type=float, default=1.0, help="times the recorded pace")
    parser.add_argument("--delay", type=float, default=1.0, help="seconds to be found before it starts")
    parser.add_argument("--clock", action="store_true", help="publish the recorded time on /clock")
    parser.add_argument("--topics", nargs="+", help="play only these")
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    if not arguments.bag.exists():
        parser.error(f"there is no bag at {arguments.bag}")
    if not arguments.rate > 0.0:
        parser.error(f"the rate must be positive, got {arguments.rate}")
    try:
        rclpy.init(args=sys.argv)
        try:
            print(f"played {play(arguments)} messages")
            rclpy.try_shutdown()
        except Exception:  # Ctrl-C shuts rclpy down, which may fail whatever call is under way
            if rclpy.ok():
                raise
    except KeyboardInterrupt:
        pass  # Ctrl-C


if __name__ == "__main__":
    main()
