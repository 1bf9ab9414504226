#!/usr/bin/env python3
"""Logs every trusted pose, and the reason when there is none, until Ctrl-C.

    python3 examples/pose_subscriber.py --ros-args -r __ns:=/receiver

Needs rclpy and the messages of tanker_pose: a sourced workspace, or `.venv` of `tests/setup`.
"""

import time

import numpy as np
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from tanker_pose.msg import EstimatorStatus


class PoseSubscriber(Node):
    def __init__(self):
        super().__init__("pose_subscriber")
        self.latest = time.monotonic()
        self.create_subscription(PoseWithCovarianceStamped, "pose", self.on_pose, 10)
        self.create_subscription(EstimatorStatus, "status", self.on_status, 10)
        self.create_timer(1.0, self.on_second)

    def on_pose(self, message):  # comes for trusted frames only
        self.latest = time.monotonic()
        position = message.pose.pose.position  # of the tanker: right, down, ahead
        sigma = np.sqrt(np.diag(np.reshape(message.pose.covariance, (6, 6))))
        if sigma[:3].max() > 0.5:  # m; your own limit
            self.get_logger().warning(f"too uncertain: {sigma[:3]} m")
            return
        self.get_logger().info(f"{position.z:.2f} m ahead, sigma {sigma[2]:.2f} m")

    def on_status(self, message):  # comes for every frame
        if message.outcome != EstimatorStatus.OK:
            self.get_logger().warning(f"no pose ({message.outcome}): {message.message}")
        elif message.rejected_ids:
            self.get_logger().info(f"left out as wrong: {list(message.rejected_ids)}")

    def on_second(self):  # when detections stop, neither pose nor status comes
        age = time.monotonic() - self.latest
        if age > 2.0:  # s
            self.get_logger().warning(f"no pose for {age:.0f} s")


try:
    rclpy.init()
    try:
        rclpy.spin(PoseSubscriber())
    except Exception:  # Ctrl-C shuts rclpy down, which may fail whatever call is under way
        if rclpy.ok():
            raise
except KeyboardInterrupt:
    pass  # Ctrl-C
