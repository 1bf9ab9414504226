#!/usr/bin/env python3
"""Writes the binary seeds of `corpus/`: messages and recordings as rosbags writes them, not as the code under test does.

    python3 fuzz/write_seeds.py

Needs rosbags (from pip), but no ROS. The same versions give the same bytes.
"""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "examples" / "bags"))

from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import get_types_from_msg  # noqa: E402
from tanker_types import typestore  # noqa: E402

CORPUS = ROOT / "fuzz" / "corpus"
FIXTURES = ROOT / "tests" / "harness" / "fixtures"
FIRST_NS = 1_700_000_000_000_000_000
PERIOD_NS = 50_000_000
# The tanker of the marker map `paper`, 15 m ahead: marker id, column and row, px.
PIXELS = {
    1: (462.1, 65.4),
    2: (27.9, 36.7),
    3: (311.5, 86.9),
    4: (177.1, 78.3),
    5: (247.7, 22.7),
    6: (254.0, 34.7),
}

store = typestore()
for package in ["vision_msgs", "apriltag_msgs", "px4_msgs", "mavros_msgs"]:
    for path in sorted((FIXTURES / package / "msg").glob("*.msg")):
        name = f"{package}/msg/{path.stem}"
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), name))


def default(name):
    """A message whose numbers are zero and whose lists are empty."""
    values = {}
    for field, (kind, what) in store.get_msgdef(name).fields:
        node = kind.name
        if node == "NAME":
            values[field] = default(what)
        elif node == "BASE":
            base = what[0]
            values[field] = "" if base in ("string", "wstring") else (False if base == "bool" else 0)
        elif node == "ARRAY":
            (inner, element), count = what
            if inner.name == "NAME":
                values[field] = [default(element) for _ in range(count)]
            else:
                values[field] = np.zeros(count, dtype=dtype(element[0]))
        else:
            inner, element = what[0]
            is_number = inner.name == "BASE" and element[0] not in ("string", "wstring")
            values[field] = np.zeros(0, dtype=dtype(element[0])) if is_number else []
    return store.types[name](**values)


def dtype(base):
    return {"octet": np.uint8, "byte": np.uint8, "char": np.uint8}.get(base, getattr(np, base, np.float64))


def header(number):
    made = default("std_msgs/msg/Header")
    ns = FIRST_NS + number * PERIOD_NS
    made.stamp.sec, made.stamp.nanosec = ns // 10**9, ns % 10**9
    made.frame_id = "camera"
    return made


def camera_info(number):
    info = default("sensor_msgs/msg/CameraInfo")
    info.header = header(number)
    info.width, info.height, info.distortion_model = 508, 412, "plumb_bob"
    info.d = np.array([-0.1, 0.01, 0.001, -0.001, 0.0])
    info.k = np.array([571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0])
    info.r = np.eye(3).ravel()
    info.p = np.array([571.0, 0.0, 254.0, 0.0, 0.0, 571.0, 206.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    return info


def feature_points(number):
    made = default("tanker_pose/msg/FeaturePointArray")
    made.header = header(number)
    point = store.types["tanker_pose/msg/FeaturePoint"]
    made.points = [point(id=i, u=u + 0.1 * number, v=v, sigma=0.5) for i, (u, v) in PIXELS.items()]
    return made


def detections(number):
    made = default("vision_msgs/msg/Detection2DArray")
    made.header = header(number)
    for i, (u, v) in PIXELS.items():
        one = default("vision_msgs/msg/Detection2D")
        one.header, one.id = header(number), str(i)
        one.bbox.center.position.x, one.bbox.center.position.y = u, v
        one.bbox.size_x = one.bbox.size_y = 4.0
        hypothesis = default("vision_msgs/msg/ObjectHypothesisWithPose")
        hypothesis.hypothesis.class_id, hypothesis.hypothesis.score = str(i), 0.9
        one.results = [hypothesis]
        made.detections.append(one)
    return made


def tags(number):
    made = default("apriltag_msgs/msg/AprilTagDetectionArray")
    made.header = header(number)
    for i in range(3):
        one = default("apriltag_msgs/msg/AprilTagDetection")
        one.family, one.id, one.decision_margin = "tag36h11", i, 60.0
        for corner, (u, v) in zip(one.corners, [(0, 40), (40, 40), (40, 0), (0, 0)], strict=True):
            corner.x, corner.y = 100.0 + 120.0 * i + u, 100.0 + v
        made.detections.append(one)
    return made


def attitude(name):
    made = default(name)
    if name == "sensor_msgs/msg/Imu":
        made.header, made.orientation.w = header(0), 1.0
    else:
        made.timestamp = made.timestamp_sample = 1_000_000
        made.q = np.array([1, 0, 0, 0], dtype=np.float32)
    return made


# By the letters of `messages::cdr`.
MESSAGES = [
    feature_points(0),
    detections(0),
    tags(0),
    camera_info(0),
    attitude("sensor_msgs/msg/Imu"),
    attitude("px4_msgs/msg/VehicleAttitude"),
    default("geometry_msgs/msg/PoseStamped"),
    default("geometry_msgs/msg/PoseWithCovarianceStamped"),
    default("nav_msgs/msg/Odometry"),
    default("tf2_msgs/msg/TFMessage"),
    default("diagnostic_msgs/msg/DiagnosticArray"),
    default("visualization_msgs/msg/MarkerArray"),
    default("tanker_pose/msg/EstimatorStatus"),
    default("tanker_pose/msg/Integrity"),
]


def bag(path, storage):
    """An approach of five frames."""
    import shutil
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "bag"
        with Writer(made, version=9, storage_plugin=storage) as writer:
            topics = [("/camera_info", camera_info), ("/feature_points", feature_points)]
            channels = [
                (make, writer.add_connection(topic, make(0).__msgtype__, typestore=store)) for topic, make in topics
            ]
            for number in range(5):
                for make, channel in channels:
                    message = make(number)
                    data = store.serialize_cdr(message, message.__msgtype__)
                    writer.write(channel, FIRST_NS + number * PERIOD_NS, data)
        (file,) = [file for file in made.iterdir() if file.suffix in (".mcap", ".db3")]
        shutil.copy(file, path)


def main():
    for folder in ["cdr", "recording"]:
        (CORPUS / folder).mkdir(parents=True, exist_ok=True)
    for letter, message in zip("abcdefghijklmn", MESSAGES, strict=True):
        data = bytes(store.serialize_cdr(message, message.__msgtype__))
        name = message.__msgtype__.rsplit("/", 1)[1]
        (CORPUS / "cdr" / name).write_bytes(letter.encode() + data)
    bag(CORPUS / "recording" / "approach.mcap", StoragePlugin.MCAP)
    bag(CORPUS / "recording" / "approach.db3", StoragePlugin.SQLITE3)


if __name__ == "__main__":
    main()
