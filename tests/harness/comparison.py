"""What outputs say against what is true, strict enough that a wrong frame, order or unit cannot pass.

Each error is judged by the covariance that comes with it, from both sides: no component may be too far off, and the
mean of the normalised squares over a flight has to be near its expectation. A covariance that is too large would hide
a wrong mean and fails as one that is too small.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped

from harness import messages, paper, sinks
from harness.approach import (
    CAMERA_IN_RECEIVER,
    PROBE_TIP_IN_RECEIVER,
    RECEPTACLE_IN_TANKER,
    Truth,
)
from harness.rotations import Array, from_quaternion, log, skew, to_quaternion
from harness.sinks import FRD_FROM_FLU, NED_FROM_ENU

# Standard deviations: of a few thousand normal numbers none lies further out, one run in a thousand apart.
FARTHEST_SIGMAS = 5.0
# rad; PX4's quaternions are in single precision.
SAME_ATTITUDE = 1e-5
# Errors of the track are alike for about a second, so of ten frames one counts.
CORRELATED_FRAMES = 10
# The track expects manoeuvres that a straight flight does not have, so its squares are smaller than their number. For a
# steady filter of positions and velocities the noise of the frames alone makes 3/4 of the variance of a position, 1/4 of
# a velocity's, and 1/2 of the squares of both together. At least half of that has to be there.
LEAST_SHARE_OF_TRACK = {"position": 3 / 8, "velocity": 1 / 8, "motion": 1 / 4}

# What comes from the track; the others come from single frames.
OF_TRACK = {"receptacle", "px4_landing_target"}

# An error and its covariance.
Errors = dict[str, tuple[Array, Array]]


def vector(v: Any) -> Array:
    return np.array([v.x, v.y, v.z])


def _pose_covariance(truth: Truth, pose: PoseWithCovarianceStamped) -> tuple[Array, Array]:
    """Of the receptacle in FRD and of the attitude in camera axes, from the pose's covariance."""
    covariance = messages.covariance_of(pose)
    arm = truth.camera_from_tanker.rotation @ RECEPTACLE_IN_TANKER
    moved = np.hstack([np.eye(3), -skew(arm)])
    frd_from_camera = FRD_FROM_FLU @ paper.CAMERA_FROM_RECEIVER.T
    to_frd = frd_from_camera @ moved
    return to_frd @ covariance @ to_frd.T, covariance[3:, 3:]


def _turn(truth: Truth, frd_from_tanker_frd: Array) -> Array:
    """How far an attitude of the tanker is from the true one, in camera axes."""
    found = FRD_FROM_FLU @ frd_from_tanker_frd @ FRD_FROM_FLU
    return log(paper.CAMERA_FROM_RECEIVER @ found @ truth.camera_from_tanker.rotation.T)


def _of_poses(truth: Truth, position: Array, rotation: Array, pose: Any) -> Errors:
    """Of a target in FRD, which brings no covariance."""
    of_position, of_attitude = _pose_covariance(truth, pose)
    return {
        "position": (position - truth.in_frd, of_position),
        "attitude": (_turn(truth, rotation), of_attitude),
    }


def _receptacle(truth: Truth, m: Any, _pose: Any) -> Errors:
    found = np.concatenate([vector(m.position), vector(m.velocity)])
    expected = np.concatenate([truth.from_probe, truth.rate_of("from_probe")])
    return {"motion": (found - expected, np.array(m.covariance).reshape(6, 6))}


def _px4_landing_target(truth: Truth, m: Any, _pose: Any) -> Errors:
    position = np.array([m.x_rel, m.y_rel, m.z_rel])
    velocity = np.array([m.vx_rel, m.vy_rel, m.vz_rel])
    of_position = np.diag([m.cov_x_rel, m.cov_y_rel, m.cov_z_rel])
    of_velocity = np.diag([m.cov_vx_rel, m.cov_vy_rel, m.cov_vz_rel])
    return {
        "position": (position - truth.in_ned, of_position),
        "velocity": (velocity - truth.rate_of("in_ned"), of_velocity),
    }


def _px4_fiducial_marker(truth: Truth, m: Any, _pose: Any) -> Errors:
    w, x, y, z = (float(q) for q in m.q)
    turn = log(from_quaternion(x, y, z, w) @ truth.ned_from_frd.T)
    assert np.linalg.norm(turn) < SAME_ATTITUDE, f"q is off by {np.linalg.norm(turn)} rad"
    return {"position": (np.array(m.rel_pos) - truth.in_frd, np.diag(m.cov_rel_pos))}


def _mavros_landing_target(truth: Truth, m: Any, pose: Any) -> Errors:
    return _of_poses(truth, *sinks.through_mavros(m.pose), pose)


def _mavros_pose(truth: Truth, m: Any, pose: Any) -> Errors:
    position, rotation = sinks.through_mavros(m.pose)
    frd_from_ned = truth.ned_from_frd.T
    return _of_poses(truth, frd_from_ned @ position, frd_from_ned @ rotation, pose)


_ERRORS: dict[str, Callable[[Truth, Any, Any], Errors]] = {
    "receptacle": _receptacle,
    "px4_landing_target": _px4_landing_target,
    "px4_fiducial_marker": _px4_fiducial_marker,
    "mavros_landing_target": _mavros_landing_target,
    "mavros_pose": _mavros_pose,
}


def mean_bounds(what: str, dimensions: int, frames: int, of_track: bool) -> tuple[float, float]:
    """Where the mean of normalised squares has to lie.

    Its variance is taken for the worst case, components of one frame that all are the same number, since some messages
    tell variances alone.
    """
    independent = frames / CORRELATED_FRAMES if of_track else frames
    scatter = FARTHEST_SIGMAS * np.sqrt(2 / independent)
    least = LEAST_SHARE_OF_TRACK[what] if of_track else 1 - scatter
    return least * dimensions, (1 + scatter) * dimensions


def judge(
    name: str, told: Mapping[int, Any], poses: Mapping[int, PoseWithCovarianceStamped]
) -> list[str]:
    """Why the messages of a flight, by index, are not true; none for those that are."""
    reasons: list[str] = []
    squares: dict[str, list[float]] = {}
    dimensions: dict[str, int] = {}
    for index, message in told.items():
        try:
            errors = _ERRORS[name](Truth(index), message, poses[index])
        except AssertionError as error:
            reasons.append(f"{index}: {error}")
            continue
        for what, (error, covariance) in errors.items():
            sigmas = np.abs(error) / np.sqrt(covariance.diagonal())
            if not np.all(sigmas < FARTHEST_SIGMAS):
                reasons.append(f"{index}: {what} is off by {sigmas} sigmas")
            squares.setdefault(what, []).append(float(error @ np.linalg.solve(covariance, error)))
            dimensions[what] = len(error)
    for what, of_flight in squares.items():
        low, high = mean_bounds(what, dimensions[what], len(of_flight), name in OF_TRACK)
        mean = np.mean(of_flight)
        if not low < mean < high:
            reasons.append(f"mean square of {what} is {mean:.2f}, expected {low:.2f} to {high:.2f}")
    return reasons


# Faults that a message's own form does not show, one at a time.
Spoil = Callable[[Truth, Any], None]


def _arm(truth: Truth) -> Array:
    """From the tanker's origin to the receptacle, FRD."""
    return FRD_FROM_FLU @ truth.receiver_from_tanker @ RECEPTACLE_IN_TANKER


def _swing(truth: Truth) -> Array:
    """Velocity of the receptacle against the tanker's origin, receiver axes: omega x R l."""
    return truth.rate_of("from_probe") - truth.rate_of("tanker_in_receiver")


def _put(v: Any, values: Array) -> None:
    v.x, v.y, v.z = (float(value) for value in values)


def _move(of: str) -> Callable[[Any, Array], None]:
    """Adds to the position of a message: to fields of its own, or to a pose that MAVROS will turn."""

    def move(m: Any, shift: Array) -> None:
        if of == "rel_pos":
            m.rel_pos = np.array(m.rel_pos + shift, dtype=np.float32)
        elif of == "rel":
            for axis, by in zip("xyz", shift, strict=True):
                setattr(m, f"{axis}_rel", getattr(m, f"{axis}_rel") + float(by))
        else:
            _put(m.pose.position, vector(m.pose.position) + NED_FROM_ENU @ shift)

    return move


def _landing_target(change: Callable[[Array], Array], prefix: str = "") -> Spoil:
    def spoil(_truth: Truth, m: Any) -> None:
        names = [f"{prefix}{axis}_rel" for axis in "xyz"]
        for name, value in zip(names, change(np.array([getattr(m, n) for n in names])), strict=True):
            setattr(m, name, float(value))

    return spoil


def _each(*spoils: Spoil) -> Spoil:
    def spoil(truth: Truth, m: Any) -> None:
        for one in spoils:
            one(truth, m)

    return spoil


def _orientation(change: Callable[[Truth, Array], Array]) -> Spoil:
    """Changes the rotation that MAVROS makes of a pose."""

    def spoil(truth: Truth, m: Any) -> None:
        q = m.pose.orientation
        rotation = NED_FROM_ENU @ from_quaternion(q.x, q.y, q.z, q.w) @ FRD_FROM_FLU
        wrong = NED_FROM_ENU.T @ change(truth, rotation) @ FRD_FROM_FLU.T
        q.x, q.y, q.z, q.w = to_quaternion(wrong)

    return spoil


def _wxyz(_truth: Truth, m: Any) -> None:
    q = m.pose.orientation
    q.x, q.y, q.z, q.w = q.w, q.x, q.y, q.z


def _turn_pose(by: Array) -> Spoil:
    """Turns the vector that MAVROS makes of a pose."""

    def spoil(_truth: Truth, m: Any) -> None:
        in_ned = NED_FROM_ENU @ vector(m.pose.position)
        _put(m.pose.position, NED_FROM_ENU.T @ by @ in_ned)

    return spoil


def _receptacle_turned(truth: Truth, m: Any) -> None:
    for v in (m.position, m.velocity):
        _put(v, FRD_FROM_FLU @ vector(v))


def _receptacle_moved(shift: Callable[[Truth], Array]) -> Spoil:
    return lambda truth, m: _put(m.position, vector(m.position) + shift(truth))


def _covariance_as_sigmas(_truth: Truth, m: Any) -> None:
    covariance = np.array(m.covariance).reshape(6, 6)
    sigmas = np.sqrt(covariance.diagonal())
    m.covariance = (covariance / np.sqrt(np.outer(sigmas, sigmas))).ravel()


def _in_ned(vector_in_receiver: Callable[[Truth], Array]) -> Callable[[Truth], Array]:
    return lambda truth: truth.ned_from_frd @ FRD_FROM_FLU @ vector_in_receiver(truth)


def _velocity_without(part: Callable[[Truth], Array]) -> Spoil:
    return lambda truth, m: _landing_target(lambda v: v - part(truth), "v")(truth, m)


def _lever_arms(move: Callable[[Any, Array], None], to_axes: Callable[[Truth], Array]) -> list:
    """Lever arms that are forgotten, for a message in other axes than FRD."""
    arms: list[tuple[str, Callable[[Truth], Array]]] = [
        ("the tanker's origin for the receptacle", lambda t: -_arm(t)),
        ("the camera for the receiver's origin", lambda _: -FRD_FROM_FLU @ CAMERA_IN_RECEIVER),
        ("the probe tip for the receiver's origin", lambda _: -FRD_FROM_FLU @ PROBE_TIP_IN_RECEIVER),
    ]

    def dropped(arm: Callable[[Truth], Array]) -> Spoil:
        return lambda truth, m: move(m, to_axes(truth) @ arm(truth))

    return [(name, dropped(arm)) for name, arm in arms]


def _spin(truth: Truth) -> Array:
    """What the receiver's own turn adds to the velocity in NED."""
    return truth.rate_of("in_ned") - truth.ned_from_frd @ truth.rate_of("in_frd")


def _frd_attitude(truth: Truth) -> Array:
    return FRD_FROM_FLU @ truth.receiver_from_tanker @ FRD_FROM_FLU


def _attitude_replaced(by: Callable[[Truth], Array]) -> Spoil:
    """Puts something else in the place of the tanker's attitude in the receiver, in whichever axes it is told."""
    return _orientation(lambda truth, rotation: rotation @ _frd_attitude(truth).T @ by(truth))


_ORIENTATIONS: list[tuple[str, Spoil]] = [
    ("no rotation", _attitude_replaced(lambda _: np.eye(3))),
    ("the receiver's rotation in the tanker", _attitude_replaced(lambda t: _frd_attitude(t).T)),
    ("a rotation of FLU", _attitude_replaced(lambda t: t.receiver_from_tanker)),
    ("wxyz", _wxyz),
]


FAULTS: dict[str, list[tuple[str, Spoil]]] = {
    "receptacle": [
        ("FRD for FLU", _receptacle_turned),
        ("standard deviations for variances", _covariance_as_sigmas),
        ("the receiver's origin for the probe tip", _receptacle_moved(lambda _: PROBE_TIP_IN_RECEIVER)),
        ("the camera for the receiver's origin", _receptacle_moved(lambda _: -CAMERA_IN_RECEIVER)),
        (
            "the tanker's origin for the receptacle",
            _receptacle_moved(lambda t: -t.receiver_from_tanker @ RECEPTACLE_IN_TANKER),
        ),
        (
            "the velocity of the tanker's origin",
            lambda truth, m: _put(m.velocity, vector(m.velocity) - _swing(truth)),
        ),
    ],
    "px4_landing_target": [
        (
            "ENU for NED",
            _each(_landing_target(NED_FROM_ENU.T.dot), _landing_target(NED_FROM_ENU.T.dot, "v")),
        ),
        ("a velocity in ENU", _landing_target(NED_FROM_ENU.T.dot, "v")),
        ("standard deviations of the position for variances", _landing_target(np.sqrt, "cov_")),
        ("standard deviations of the velocity for variances", _landing_target(np.sqrt, "cov_v")),
        ("the velocity of the tanker's origin", _velocity_without(_in_ned(_swing))),
        ("a velocity without the receiver's turn", _velocity_without(_spin)),
        *_lever_arms(_move("rel"), lambda truth: truth.ned_from_frd),
    ],
    "px4_fiducial_marker": [
        ("FLU for FRD", lambda _, m: setattr(m, "rel_pos", m.rel_pos * np.float32([1, -1, -1]))),
        ("xyzw", lambda _, m: setattr(m, "q", np.roll(m.q, -1))),
        ("standard deviations for variances", lambda _, m: setattr(m, "cov_rel_pos", np.sqrt(m.cov_rel_pos))),
        *_lever_arms(_move("rel_pos"), lambda _: np.eye(3)),
    ],
    "mavros_landing_target": [
        ("FLU for FRD", _turn_pose(FRD_FROM_FLU)),
        ("ENU for NED", _turn_pose(NED_FROM_ENU)),
        *_ORIENTATIONS,
        *_lever_arms(_move("pose"), lambda _: np.eye(3)),
    ],
    "mavros_pose": [
        ("NED for ENU", _turn_pose(NED_FROM_ENU)),
        ("FLU for FRD", lambda t, m: _turn_pose(t.ned_from_frd @ FRD_FROM_FLU @ t.ned_from_frd.T)(t, m)),
        ("axes of the body", lambda t, m: _turn_pose(t.ned_from_frd.T)(t, m)),
        *_ORIENTATIONS,
        *_lever_arms(_move("pose"), lambda truth: truth.ned_from_frd),
    ],
}
