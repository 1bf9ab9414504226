"""A node with every input in use, each of which can be spoilt for some frames, and the truth behind all of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Quaternion, Vector3
from px4_msgs.msg import VehicleAttitude
from rosgraph_msgs.msg import Clock
from scipy.stats import chi2
from sensor_msgs.msg import Imu
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from harness import messages, paper
from harness.approach import CAMERA_IN_RECEIVER, RECEPTACLE_IN_TANKER
from harness.consistency import nees
from harness.estimator import FEATURE_POINTS, Answer, Detector, Estimator, outcome_name
from harness.messages import key, pose_of
from harness.peer import BEST_EFFORT, Peer
from harness.rotations import Array, Pose, about_x, about_y, about_z, to_quaternion
from harness.sinks import FRD_FROM_FLU, NED_FROM_ENU
from harness.waiting import wait_until

# Of a chi-squared variable of six degrees of freedom: some thousand poses exceed it once in a hundred thousand runs.
LARGEST_NEES = float(chi2.ppf(1.0 - 1e-8, 6))
# m; of a receptacle in local axes at 15 m, from pixels with noise. What faults do to it is metres.
LOCAL_M = 0.8
# m/s²; what an accelerometer at rest measures.
GRAVITY = 9.8
# s; for attitudes to be heard before the frame that they belong to.
AHEAD_S = 0.02
# s; for what must not come.
QUIET_S = 0.1

# A message, and how often the fault has been injected: what is sent in its place; None: nothing.
Spoil = Callable[[Any, int], Any]


def as_it_is(message: Any, _: int) -> Any:
    return message


def nothing(_: Any, __: int) -> None:
    return None


def truth(index: float) -> Pose:
    """A tanker that sways before a receiver that closes up and falls back, at up to half a metre a second."""
    t = index * messages.FRAME_PERIOD_NS * 1e-9
    x, y, z = 15.0 + 0.5 * np.sin(t), 0.2 * np.sin(0.7 * t), 4.0 + 0.2 * np.sin(0.9 * t)
    return paper.camera_from_tanker(2.0 * np.sin(0.8 * t), 1.0, -2.0 * np.cos(0.5 * t), (x, y, z))


def quiet_frame(index: int, rng: np.random.Generator) -> Any:
    """Detections with less noise than they state: no frame without a fault is refused by chance."""
    pixels = paper.marker_pixels(truth(index))
    noise = rng.normal(0.0, 0.6 * messages.SIGMA_PX, pixels.shape)
    return messages.feature_points(index, pixels + noise, sigmas_px=messages.SIGMA_PX)


def ned_from_receiver(index: float) -> Array:
    """FRD; it turns to the right, nose up, right wing down."""
    t = index * messages.FRAME_PERIOD_NS * 1e-9
    return about_z(np.radians(40.0 + 3.0 * t)) @ about_y(np.radians(4.0)) @ about_x(np.radians(9.0))


def ned_from_tanker(index: float) -> Array:
    relative = paper.CAMERA_FROM_RECEIVER.T @ truth(index).rotation
    return ned_from_receiver(index) @ FRD_FROM_FLU @ relative @ FRD_FROM_FLU


def receptacle_in_enu(index: int) -> Array:
    """About the receiver's origin."""
    pose = truth(index)
    in_camera = pose.rotation @ RECEPTACLE_IN_TANKER + pose.translation
    in_receiver = paper.CAMERA_FROM_RECEIVER.T @ in_camera + CAMERA_IN_RECEIVER
    return NED_FROM_ENU.T @ ned_from_receiver(index) @ FRD_FROM_FLU @ in_receiver


def imu(index: float, ned_from_frd: Array) -> Imu:
    """ENU from FLU, with what the accelerometer measures."""
    x, y, z, w = to_quaternion(NED_FROM_ENU.T @ ned_from_frd @ FRD_FROM_FLU)
    fx, fy, fz = FRD_FROM_FLU @ ned_from_frd.T @ [0.0, 0.0, -GRAVITY]
    return Imu(
        header=Header(stamp=messages.stamp_of(int(index)), frame_id="base_link"),
        orientation=Quaternion(x=x, y=y, z=z, w=w),
        linear_acceleration=Vector3(x=fx, y=fy, z=fz),
    )


def px4(index: float, ned_from_frd: Array) -> VehicleAttitude:
    stamp = messages.stamp_of(int(index))
    stamp_us = stamp.sec * 1_000_000 + stamp.nanosec // 1000
    x, y, z, w = to_quaternion(ned_from_frd)
    return VehicleAttitude(
        timestamp=stamp_us, timestamp_sample=stamp_us, q=np.array([w, x, y, z], dtype=np.float32)
    )


RECEIVERS: dict[str, tuple[type, str, Callable[[float, Array], Any]]] = {
    "px4": (VehicleAttitude, "/fmu/out/vehicle_attitude", px4),
    "imu": (Imu, "/mavros/imu/data", imu),
}


@dataclass(frozen=True)
class Seen:
    """What became of a frame; `answer`: None where there was none."""

    index: int
    stamp: tuple[int, int]
    answer: Answer | None

    @property
    def outcome(self) -> str:
        return "none" if self.answer is None else self.answer.outcome

    @property
    def nees(self) -> float | None:
        if self.answer is None or self.answer.pose is None:
            return None
        pose = self.answer.pose
        found, covariance = pose_of(pose.pose.pose), messages.covariance_of(pose)
        return float(nees(truth(self.index), found, covariance))


class Lane:
    """A node, and all that it listens to."""

    def __init__(
        self,
        peer: Peer,
        start: Callable[..., Estimator],
        rng: np.random.Generator,
        *arguments: str,
        detector: Detector = FEATURE_POINTS,
        detect: Callable[[int, np.random.Generator], Any] | None = None,
        receiver: str | None = None,
        tanker: bool = False,
        clock: bool = False,
        camera: bool = True,
    ) -> None:
        self.peer = peer
        self.rng = rng
        self._detect = detect or quiet_frame
        self.local: list[PoseStamped] = peer.collect(PoseStamped, "/mavros/landing_target/pose")
        self.reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
        create = peer.node.create_publisher
        self._receiver = self._tanker = self._clock = None
        if receiver is not None:
            kind, topic, self._tell = RECEIVERS[receiver]
            self._receiver = create(kind, topic, BEST_EFFORT)
        if tanker:
            self._tanker = create(Imu, "/tanker_attitude", BEST_EFFORT)
        if clock:
            self._clock = create(Clock, "/clock", BEST_EFFORT)
        self.estimator = start(*arguments, detector=detector)
        self.info = messages.camera_info()
        if camera:
            self.estimator.use_camera(self.info)

    def run(
        self,
        frames: int,
        *,
        detections: Spoil = as_it_is,
        receiver: Spoil = as_it_is,
        tanker: Spoil = as_it_is,
        camera: Spoil = nothing,
        clock: Spoil = as_it_is,
        answered: bool = True,
        stride: int = 1,
    ) -> list[Seen]:
        """Sends frames and what belongs to them, each spoilt in its way; what became of them."""
        seen = []
        for k in range(frames):
            for _ in range(stride):
                index = self.estimator.next_index()
            self._send(self.estimator.info_publisher, camera(messages.camera_info(), k))
            if self._clock is not None:
                self._send(self._clock, clock(Clock(clock=messages.stamp_of(index)), k))
            for step in (-2, -1, 0, 1):
                if self._receiver is not None:
                    told = self._tell(index + step, ned_from_receiver(index + step))
                    self._send(self._receiver, receiver(told, 4 * k + step + 2))
                if self._tanker is not None:
                    told = imu(index + step, ned_from_tanker(index + step))
                    self._send(self._tanker, tanker(told, 4 * k + step + 2))
            if self._receiver is not None or self._tanker is not None or camera is not nothing:
                self.peer.spin_for(AHEAD_S)
            seen += self._ask(index, detections(self._detect(index, self.rng), k), answered)
        return seen

    def _send(self, publisher: Any, message: Any) -> None:
        if message is not None:
            publisher.publish(message)

    def _ask(self, index: int, frame: Any, answered: bool) -> list[Seen]:
        estimator = self.estimator
        if frame is None:
            self.peer.spin_for(AHEAD_S)
            return []
        if isinstance(frame, bytes) or not answered:
            estimator.send(frame)
            self.peer.spin_for(QUIET_S)
            return []
        stamp = key(frame.header.stamp)
        statuses = lambda: estimator.statuses.get(stamp, [])  # noqa: E731
        poses = lambda: estimator.poses.get(stamp, [])  # noqa: E731
        before, poses_before = len(statuses()), len(poses())
        estimator.send(frame)
        self.peer.spin_until(lambda: len(statuses()) > before, f"the answer to frame {stamp}")
        status = statuses()[-1]
        if outcome_name(status.outcome) == "OK":
            self.peer.spin_until(lambda: len(poses()) > poses_before, f"the pose of {stamp}")
        pose = poses()[-1] if len(poses()) > poses_before else None
        return [Seen(index, stamp, Answer(status, pose))]

    def local_errors_m(self, seen: list[Seen]) -> list[float]:
        """How far the outputs in local axes for these frames are from the truth."""
        self.peer.spin_for(QUIET_S)
        indices = {s.stamp: s.index for s in seen}
        errors = []
        for message in self.local:
            index = indices.get(key(message.header.stamp))
            if index is not None:
                p = message.pose.position
                errors.append(float(np.linalg.norm([p.x, p.y, p.z] - receptacle_in_enu(index))))
        return errors

    def fault(self, name: str) -> str:
        """What the latest report says of a fault."""
        if not self.reports:
            return ""
        (status,) = (s for s in self.reports[-1].status if s.name.endswith(": faults"))
        (value,) = (pair.value for pair in status.values if pair.key == name)
        return value

    def wait_for_fault(self, name: str, words: str, spoilt: Callable[[], object]) -> None:
        """Goes on with the fault until a report names it: there is one a second."""
        wait_until(lambda: words in self.fault(name), f"{name}: {words}", pause=spoilt)

    def reset(self) -> None:
        self.peer.call(Trigger, "/tanker_pose/reset", Trigger.Request())


def at(sec: int, nanosec: int = 0) -> Time:
    return Time(sec=sec, nanosec=nanosec)
