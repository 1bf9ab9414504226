"""Flight stacks around a node with all outputs on: what they send to it, and what they receive."""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from mavros_msgs.msg import LandingTarget
from px4_msgs.msg import FiducialMarkerPosReport, LandingTargetPose, VehicleAttitude
from sensor_msgs.msg import Imu
from tanker_pose.msg import ReceptacleState

from harness import messages
from harness.approach import CAMERA, FRAMES, SETUP, STRIDE, Truth
from harness.estimator import Answer, Estimator
from harness.peer import BEST_EFFORT, Peer
from harness.waiting import wait_until

SIGMA_PX = 0.5

TOPICS: dict[str, tuple[type, str]] = {
    "receptacle": (ReceptacleState, "/receptacle"),
    "px4_landing_target": (LandingTargetPose, "/fmu/in/landing_target_pose"),
    "px4_fiducial_marker": (FiducialMarkerPosReport, "/fmu/in/fiducial_marker_pos_report"),
    "mavros_landing_target": (LandingTarget, "/mavros/landing_target/raw"),
    "mavros_pose": (PoseStamped, "/mavros/landing_target/pose"),
}
ATTITUDES: dict[str, tuple[type, str, Callable[[Truth], Any]]] = {
    "px4": (VehicleAttitude, "/fmu/out/vehicle_attitude", lambda truth: truth.vehicle_attitude),
    "imu": (Imu, "/mavros/imu/data", lambda truth: truth.imu),
}


# These two exclude each other, so a flight has one of them.
PX4_OUTPUTS = ("px4_landing_target", "px4_fiducial_marker")


def outputs_with(px4: str) -> list[str]:
    """All outputs but the other one for PX4."""
    return [name for name in TOPICS if name == px4 or name not in PX4_OUTPUTS]


def all_on(attitude: str, px4: str, setup: Path) -> list[str]:
    arguments = ["-p", f"refuelling:={setup}", "-p", f"attitude:={attitude}"]
    # The tanker of this approach is turned by tens of degrees, so that no convention is without effect.
    arguments += ["-p", "max_attitude_deviation_deg:=60.0"]
    for name in outputs_with(px4):
        arguments += ["-p", f"publish_{name}:=true"]
    return arguments


def stamp_us(message: Any) -> int:
    """The time of a message, whichever way it tells it."""
    if hasattr(message, "timestamp"):
        return message.timestamp
    stamp = message.header.stamp
    return stamp.sec * 1_000_000 + stamp.nanosec // 1000


class Flight:
    """A node with all outputs on, a flight stack around it, and an approach that goes on frame by frame."""

    def __init__(
        self,
        peer: Peer,
        start: Callable[..., Estimator],
        rng: np.random.Generator,
        attitude: str = "px4",
        px4: str = "px4_landing_target",
        setup: Path = SETUP,
        *more: str,
    ) -> None:
        self.peer = peer
        self.rng = rng
        self.outputs = outputs_with(px4)
        self.poses: dict[int, PoseWithCovarianceStamped] = {}
        self.heard = {name: peer.collect(*TOPICS[name]) for name in self.outputs}
        self.diagnostics: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
        message_type, topic, self._tell = ATTITUDES[attitude]
        self._attitudes = peer.node.create_publisher(message_type, topic, BEST_EFFORT)
        self._attitude_topic = topic
        self._told = itertools.count(-50 * STRIDE)
        self._next_attitude = next(self._told)
        self.estimator: Estimator = start(*all_on(attitude, px4, setup), *more)
        self.estimator.use_camera(messages.camera_info(CAMERA))

    def tell_attitudes(self, up_to: int) -> None:
        """Sends all attitudes up to an index."""
        while self._next_attitude <= up_to:
            self._attitudes.publish(self._tell(Truth(self._next_attitude)))
            self._next_attitude = next(self._told)

    def frame(self, index: int) -> Answer:
        """Sends the image of an index; without lead the attitude would not be there in time."""
        truth = Truth(index)
        frame = messages.noisy_frame(
            index, truth.camera_from_tanker, self.rng, sigma_px=SIGMA_PX, camera=CAMERA
        )
        answer = self.estimator.ask(frame)
        if answer.pose is not None:
            self.poses[index] = answer.pose
        return answer

    def warm_up(self) -> None:
        """Returns when the attitude is heard: frames from before the approach are answered in NED."""
        indices = iter(range(-40 * STRIDE, 0, STRIDE))

        def ask() -> None:
            index = next(indices)
            self.tell_attitudes(index + 2 * STRIDE)
            self.frame(index)
            self.peer.spin_for(0.05)

        wait_until(lambda: bool(self.heard["mavros_pose"]), "a pose in ENU", pause=ask)

    def fly(self, frames: int = FRAMES) -> list[int]:
        """Flies; returns the indices of the frames that gave a pose."""
        good = []
        for index in range(0, frames * STRIDE + 1, STRIDE):
            self.tell_attitudes(index + 2 * STRIDE)
            if self.frame(index).outcome == "OK":
                good.append(index)
        return good

    def messages_of(self, name: str, indices: list[int]) -> dict[int, Any]:
        """The messages of one output, by index, once that of the last frame is there."""
        by_stamp = {Truth(index).stamp_us: index for index in indices}

        def found() -> dict[int, Any]:
            all_found = [m for m in self.heard[name] if stamp_us(m) in by_stamp]
            by_index = {by_stamp[stamp_us(m)]: m for m in all_found}
            assert len(by_index) == len(all_found), f"two {name} for one frame"
            return by_index

        self.peer.spin_until(lambda: indices[-1] in found(), f"{name} of the last frame")
        return found()

    def consumers_said(self) -> list[tuple[str, dict[str, str]]]:
        """What diagnostics said of the outputs: message and values."""
        return [
            (status.message, {value.key: value.value for value in status.values})
            for array in self.diagnostics
            for status in array.status
            if status.name.endswith(": consumers")
        ]
