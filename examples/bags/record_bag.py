#!/usr/bin/env python3
"""Records topics to an MCAP bag until Ctrl-C, as `ros2 bag record` does where ROS 2 is installed.

    python3 examples/bags/record_bag.py answers /pose /status

Needs rosbags, rclpy and the messages of tanker_pose. Bytes are kept as they come; a topic is recorded once it has a
publisher.
"""

import argparse
import importlib
import sys
import time
from functools import partial
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from rosbags.rosbag2 import StoragePlugin, Writer
from tanker_types import typestore


class Recorder(Node):
    def __init__(self, bag: Writer, topics: list[str]) -> None:
        super().__init__("record_bag")
        self.bag = bag
        self.types = typestore()
        self.waiting = {self.resolve_topic_name(topic) for topic in topics}
        self.count = 0
        self.create_timer(0.1, self.look)

    def look(self) -> None:
        """Subscribes to topics once they are discovered."""
        known = dict(self.get_topic_names_and_types())
        for topic in sorted(self.waiting & known.keys()):
            publishers = self.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            self.waiting.remove(topic)
            # What every publisher can give: a reliable subscription hears no best-effort publisher.
            reliable = all(
                info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in publishers
            )
            policy = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
            (ros_name, *_) = known[topic]
            connection = self.bag.add_connection(topic, ros_name, typestore=self.types)
            package, kind, name = ros_name.split("/")
            message_class = getattr(importlib.import_module(f"{package}.{kind}"), name)
            qos = QoSProfile(depth=1000, reliability=policy)
            self.create_subscription(
                message_class, topic, partial(self.keep, connection), qos, raw=True
            )
            print(f"recording {topic}", flush=True)

    def keep(self, connection, raw: bytes) -> None:
        """Writes one message, with the time at which it came."""
        self.bag.write(connection, time.time_ns(), bytes(raw))
        self.count += 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bag", type=Path, help="directory of the new bag")
    parser.add_argument("topics", nargs="+")
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    if arguments.bag.exists():
        parser.error(f"{arguments.bag} is there already")
    with Writer(arguments.bag, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        recorder = None
        try:
            rclpy.init(args=sys.argv)
            try:
                recorder = Recorder(bag, arguments.topics)
                rclpy.spin(recorder)
            except Exception:  # Ctrl-C shuts rclpy down, which may fail whatever call is under way
                if rclpy.ok():
                    raise
        except KeyboardInterrupt:
            pass  # Ctrl-C
        print(f"recorded {recorder.count if recorder else 0} messages")


if __name__ == "__main__":
    main()
