#!/usr/bin/env python3
"""Writes detections and camera info to an MCAP bag: what a detector of your own would leave behind.

    python3 examples/bags/write_bag.py approach

Needs rosbags (from pip), but no ROS. Put your own pixels in the place of `PIXELS`.
"""

import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from tanker_types import typestore

FRAMES = 90
PERIOD_NS = 33_333_333
FIRST_NS = 1_700_000_000_000_000_000
FRAME_ID = "camera"
SIGMA_PX = 0.5
# Marker id: column and row, px. The tanker of the marker map `paper`, 15 m ahead.
PIXELS = {
    1: (462.1, 65.4),
    2: (27.9, 36.7),
    3: (311.5, 86.9),
    4: (177.1, 78.3),
    5: (247.7, 22.7),
    6: (254.0, 34.7),
}

store = typestore()
types = store.types
Time = types["builtin_interfaces/msg/Time"]
Header = types["std_msgs/msg/Header"]
CameraInfo = types["sensor_msgs/msg/CameraInfo"]
RegionOfInterest = types["sensor_msgs/msg/RegionOfInterest"]
FeaturePoint = types["tanker_pose/msg/FeaturePoint"]
FeaturePointArray = types["tanker_pose/msg/FeaturePointArray"]


def camera_info(header):
    """The calibration; P repeats K where nothing is rectified."""
    return CameraInfo(
        header=header,
        width=508,
        height=412,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array([571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0]),
        r=np.eye(3).ravel(),
        p=np.array([571.0, 0.0, 254.0, 0.0, 0.0, 571.0, 206.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=RegionOfInterest(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def feature_points(header):
    """The detections of one image. No camera sees the same twice: pixels that never change are taken for a stuck one."""
    sway = 0.1 * (header.stamp.nanosec // PERIOD_NS % 2)
    points = [FeaturePoint(id=id, u=u + sway, v=v, sigma=SIGMA_PX) for id, (u, v) in PIXELS.items()]
    return FeaturePointArray(header=header, points=points)


with Writer(Path(sys.argv[1]), version=9, storage_plugin=StoragePlugin.MCAP) as bag:
    topics = {"/camera_info": camera_info, "/feature_points": feature_points}
    kinds = {"/camera_info": CameraInfo, "/feature_points": FeaturePointArray}
    connections = {
        topic: bag.add_connection(topic, kind.__msgtype__, typestore=store)
        for topic, kind in kinds.items()
    }
    for frame in range(FRAMES):
        time_ns = FIRST_NS + frame * PERIOD_NS
        stamp = Time(sec=time_ns // 1_000_000_000, nanosec=time_ns % 1_000_000_000)
        # Both with the time of the image and the frame of the camera: the node compares the frames.
        header = Header(stamp=stamp, frame_id=FRAME_ID)
        for topic, make in topics.items():
            message = make(header)
            bag.write(connections[topic], time_ns, store.serialize_cdr(message, message.__msgtype__))
print(f"wrote {FRAMES} frames")
