"""What flight stacks do with our messages: their rules of acceptance, so that a message that they drop fails here.

Each rule is that of the code that reads the message: PX4's vision_target_estimator (VTEPosition::isVisionDataValid)
and EKF2 (auxiliary velocity), px4-ros2-interface-lib's contract, MAVROS's landing_target plugin and ArduPilot's
AC_PrecLand_MAVLink. Each returns the reasons to refuse, none for a message that is taken.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from harness.messages import key
from harness.rotations import Array, from_quaternion

# us; PX4's default for measurements that count as recent (VTE_M_REC_TOUT).
RECENT_US = 1_000_000
# MAV_FRAME_BODY_FRD and MAV_FRAME_LOCAL_FRD.
FRAMES_OF_ARDUPILOT = {12, 20}
# MAV_FRAME_LOCAL_NED, which MAVROS's mav_frame is unless set.
LOCAL_NED = 1
# Of a quaternion's length, in single precision and with tf2's tolerance.
UNIT = 1e-3

NED_FROM_ENU: Array = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FROM_FLU: Array = np.diag([1.0, -1.0, -1.0])

Reasons = list[str]


def _finite(values: Any) -> bool:
    return bool(np.all(np.isfinite(np.asarray(values, dtype=float))))


def _times(now_us: int, **stamps_us: int) -> Reasons:
    reasons = []
    for name, stamp_us in stamps_us.items():
        if stamp_us == 0:
            reasons.append(f"{name} is not set")
        elif not 0 <= now_us - stamp_us <= RECENT_US:
            reasons.append(f"{name} is {now_us - stamp_us} us old")
    return reasons


def px4_fiducial_marker(message: Any, now_us: int) -> Reasons:
    """PX4's vision_target_estimator."""
    reasons = _times(now_us, timestamp_sample=message.timestamp_sample, timestamp=message.timestamp)
    if not _finite(message.rel_pos):
        reasons.append("rel_pos is not finite")
    if not _finite(message.cov_rel_pos) or np.any(np.asarray(message.cov_rel_pos) <= 0):
        reasons.append("cov_rel_pos is no variance")
    if not _finite(message.q) or abs(np.linalg.norm(message.q) - 1) > UNIT:
        reasons.append("q is no rotation")
    return reasons


def px4_landing_target(message: Any, now_us: int) -> Reasons:
    """PX4's landing_target_pose: its readers, and EKF2, which must not take a tanker for the ground."""
    reasons = _times(now_us, timestamp=message.timestamp)
    if not message.rel_pos_valid:
        reasons.append("rel_pos_valid is not set")
    if not message.rel_vel_valid:
        reasons.append("rel_vel_valid is not set")
    if message.is_static or message.rel_vel_ekf2_valid:
        reasons.append("EKF2 would take the target's velocity for its own")
    if message.abs_pos_valid:
        reasons.append("abs_pos_valid is set without a position of the vehicle")
    mean = [getattr(message, f"{axis}_rel") for axis in ("x", "y", "z", "vx", "vy", "vz")]
    if not _finite(mean) or not _finite([message.x_abs, message.y_abs, message.z_abs]):
        reasons.append("not finite")
    variances = [getattr(message, f"cov_{axis}_rel") for axis in ("x", "y", "z", "vx", "vy", "vz")]
    if not _finite(variances) or min(variances) <= 0:
        reasons.append("a variance is none")
    return reasons


def through_mavros(pose: Any) -> tuple[Array, Array]:
    """Position and rotation that MAVROS sends: ENU to NED, whatever the frame, and FLU to FRD."""
    p, q = pose.position, pose.orientation
    rotation = from_quaternion(q.x, q.y, q.z, q.w)
    return NED_FROM_ENU @ np.array([p.x, p.y, p.z]), NED_FROM_ENU @ rotation @ FRD_FROM_FLU


def _pose(pose: Any) -> Reasons:
    p, q = pose.position, pose.orientation
    reasons = []
    if not _finite([p.x, p.y, p.z]):
        reasons.append("the position is not finite")
    orientation = [q.x, q.y, q.z, q.w]
    if not _finite(orientation) or abs(np.linalg.norm(orientation) - 1) > UNIT:
        reasons.append("the orientation is no rotation")
    return reasons


def mavros_landing_target(message: Any, _now_us: int) -> Reasons:
    """MAVROS to ArduPilot's AC_PrecLand_MAVLink."""
    reasons = _pose(message.pose)
    if key(message.header.stamp) == (0, 0):
        reasons.append("the stamp is zero")
    if message.frame not in FRAMES_OF_ARDUPILOT:
        reasons.append(f"frame {message.frame} is not supported")
    if not message.distance > 0 or not _finite(message.distance):
        reasons.append("the distance is not positive")
    elif not reasons:
        line_of_sight = through_mavros(message.pose)[0] / message.distance
        # ArduPilot calls it a unit vector and never checks.
        if abs(np.linalg.norm(line_of_sight) - 1) > UNIT:
            reasons.append("position and distance contradict each other")
    if not _finite(message.angle) or not _finite(message.size):
        reasons.append("not finite")
    return reasons


class MavrosPose:
    """A consumer of poses in ENU; with `mav_frame` MAVROS's landing_target plugin and the autopilots behind it.

    The plugin drops a stamp that it has just had. It turns the pose to NED and names it as its parameter says, so no
    frame makes a relative vector in NED what an autopilot expects.
    """

    def __init__(self, mav_frame: int | None = None) -> None:
        self._last = (0, 0)
        self._mav_frame = mav_frame

    def __call__(self, message: Any, _now_us: int) -> Reasons:
        reasons = _pose(message.pose)
        stamp = key(message.header.stamp)
        if stamp == (0, 0):
            reasons.append("the stamp is zero")
        elif stamp == self._last:
            reasons.append("the stamp is that of the last one")
        self._last = stamp
        if not message.header.frame_id.strip():
            reasons.append("the frame is not named")
        if self._mav_frame == LOCAL_NED:
            reasons.append("PX4 takes LOCAL_NED as an absolute place, ArduPilot drops it")
        elif self._mav_frame in FRAMES_OF_ARDUPILOT:
            reasons.append("ArduPilot would take NED for axes of the body")
        elif self._mav_frame is not None:
            reasons.append(f"frame {self._mav_frame} is not supported")
        return reasons


Sink = Callable[[Any, int], Reasons]
