"""Bags of an approach: written from the numpy truth, recorded from the graph, read back."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from sensor_msgs.msg import CameraInfo
from tanker_pose.msg import FeaturePointArray

from harness import messages, paper
from harness.peer import Peer
from harness.rotations import Pose, to_quaternion
from harness.typestore import typestore

BAG_FORMAT = 9
# The detector of a real flight starts after the camera; it also gives the node time to be found.
CAMERA_LEAD_IN_NS = 500_000_000


def ros_name(message_type: type) -> str:
    """`package/msg/Name` of a generated message class."""
    package, _, _ = message_type.__module__.partition(".")
    return f"{package}/msg/{message_type.__name__}"


class BagWriter:
    """Messages of rclpy classes, or their raw bytes, into a bag."""

    def __init__(self, path: Path, storage: StoragePlugin, topics: dict[str, type]) -> None:
        self._types = typestore()
        self._writer = Writer(path, version=BAG_FORMAT, storage_plugin=storage)
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(topic, ros_name(kind), typestore=self._types)
            for topic, kind in topics.items()
        }

    def write(self, topic: str, time_ns: int, message: Any) -> None:
        raw = message if isinstance(message, bytes) else serialize_message(message)
        self._writer.write(self._connections[topic], time_ns, raw)

    def close(self) -> None:
        self._writer.close()


def approach(frames: int, from_m: float = 60.0, to_m: float = 12.0) -> Iterator[Pose]:
    """The tanker seen on the way in, straight behind and below it, rocking slowly."""
    for fraction in np.linspace(0.0, 1.0, frames):
        range_m = from_m + (to_m - from_m) * fraction
        swing = 2.0 * np.sin(2 * np.pi * fraction * np.array([1.0, 1.7, 2.3]))
        yield paper.camera_from_tanker(*swing, (range_m, 0.0, 0.3 * range_m))


def write_approach_bag(
    path: Path, storage: StoragePlugin, frames: int, rng: np.random.Generator
) -> dict[tuple[int, int], Pose]:
    """Writes detections, camera info and truth; returns the truth by stamp."""
    bag = BagWriter(
        path,
        storage,
        {"/camera_info": CameraInfo, "/feature_points": FeaturePointArray, "/truth": PoseStamped},
    )
    truths = {}
    for time_ns in range(0, CAMERA_LEAD_IN_NS, CAMERA_LEAD_IN_NS // 10):
        bag.write("/camera_info", time_ns, messages.camera_info())
    for index, pose in enumerate(approach(frames)):
        time_ns = CAMERA_LEAD_IN_NS + index * messages.FRAME_PERIOD_NS
        frame = messages.noisy_frame(index, pose, rng)
        truths[messages.key(frame.header.stamp)] = pose
        x, y, z = pose.translation
        qx, qy, qz, qw = to_quaternion(pose.rotation)
        truth = PoseStamped(
            header=frame.header,
            pose=PoseMessage(
                position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw)
            ),
        )
        bag.write("/camera_info", time_ns, messages.camera_info())
        bag.write("/feature_points", time_ns, frame)
        bag.write("/truth", time_ns, truth)
    bag.close()
    return truths


class Recorder:
    """Writes what it hears to a bag, byte for byte, while its peer spins."""

    def __init__(
        self, peer: Peer, path: Path, topics: dict[str, type], storage: StoragePlugin
    ) -> None:
        self._peer = peer
        self._bag = BagWriter(path, storage, topics)
        self._received = {
            topic: peer.collect(kind, topic, raw=True) for topic, kind in topics.items()
        }

    def count(self, topic: str) -> int:
        """Messages heard on a topic so far."""
        return len(self._received[topic])

    def close(self) -> None:
        """Writes the bag."""
        for topic, received in self._received.items():
            for order, raw in enumerate(received):
                self._bag.write(topic, order, bytes(raw))
        self._bag.close()


def read_bag(path: Path) -> dict[str, list[Any]]:
    """All messages of a bag as rosbags decodes them, by topic."""
    found: dict[str, list[Any]] = {}
    with AnyReader([path], default_typestore=typestore()) as reader:
        for connection, _, raw in reader.messages():
            found.setdefault(connection.topic, []).append(
                reader.deserialize(raw, connection.msgtype)
            )
    return found
