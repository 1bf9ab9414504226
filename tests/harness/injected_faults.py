"""The faults that are injected into each input, after PX4's list for its sensors, and what the node has to make of them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from harness.injection import Lane, Seen, Spoil, at, nothing

# Kinds, after `failure` of PX4.
OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT = (
    *("off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent"),
)
KINDS = (OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT)

# What poses of spoilt frames may be.
NONE, TRUE, WRONG_POSE = "none", "true", "wrong"


@dataclass(frozen=True)
class Cell:
    """A fault of one input, and what the node has to make of it."""

    kind: str
    # In words, for people.
    what: str
    inject: Callable[[Lane], list[Seen]]
    # All that answers may be, "none" if there need be none.
    outcomes: tuple[str, ...]
    # What is published as a pose while it lasts: none, true within its covariance, or wrong without notice.
    poses: str
    # The same of outputs in local axes, in lanes that have them.
    local: str = ""
    # Part of the last status' message.
    says: str = ""
    # A fault in diagnostics, and part of its words.
    fault: tuple[str, str] = ("", "")
    # Good frames until all is well again.
    recovers: int = 1
    # For people: what else there is to know.
    note: str = ""


def spoilt(change: Callable[[Any], object]) -> Spoil:
    """Each message, changed in place."""

    def spoil(message: Any, _: int) -> Any:
        change(message)
        return message

    return spoil


def frames(count: int, change: Callable[[Any], object], **more: Any) -> Callable[[Lane], list[Seen]]:
    return lambda lane: lane.run(count, detections=spoilt(change), **more)


def held(first_of: Callable[[Any], Any], put: Callable[[Any, Any], None]) -> Spoil:
    """Each message with something of the first one."""
    kept: list[Any] = []

    def spoil(message: Any, _: int) -> Any:
        kept.append(first_of(message)) if not kept else None
        put(message, kept[0])
        return message

    return spoil


def fresh(make: Callable[[], dict[str, Spoil]], count: int, **more: Any) -> Callable[[Lane], list[Seen]]:
    """Frames with a fault that remembers something, which begins anew each time."""
    return lambda lane: lane.run(count, **make(), **more)


def held_message() -> Spoil:
    kept: list[Any] = []

    def spoil(message: Any, _: int) -> Any:
        kept.append(message)
        return kept[0]

    return spoil


def undecodable(message: Any, _: int) -> bytes:
    return serialize_message(message)[:-5]


def noise(message: Any, k: int) -> bytes:
    return bytes(np.random.default_rng(k).integers(0, 256, 64, dtype=np.uint8))


def every(count: int, other: Spoil) -> Spoil:
    """One message of some is spoilt."""
    return lambda message, k: other(message, k) if k % count == 0 else message


def reversed_order(lane: Lane) -> list[Seen]:
    """Frames that arrive the newest first."""
    waiting: list[Any] = []

    def keep(message: Any, _: int) -> None:
        waiting.append(message)

    lane.run(6, detections=keep)
    last = lane.estimator.next_index() - 1
    seen = []
    for back, frame in enumerate(reversed(waiting)):
        seen += lane._ask(last - back, frame, True)
    return seen


def copy_points(message: Any, points: Any) -> None:
    message.points = points


def copy_stamp(message: Any, stamp: Any) -> None:
    message.header.stamp = stamp


def set_points(**values: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        for name, value in values.items():
            setattr(message.points[0], name, value)

    return change


def shift(*ids: int, by_px: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        for point in message.points:
            if not ids or point.id in ids:
                point.u += by_px

    return change


def exchange_sides(message: Any) -> None:
    exchanged = {1: 2, 2: 1, 3: 4, 4: 3}
    for point in message.points:
        point.id = exchanged.get(point.id, point.id)


def later(by_s: int) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        message.header.stamp.sec += by_s

    return change


def million(message: Any, _: int) -> bytes:
    """A million points, in the bytes of the middleware: rclpy would take seconds for them."""
    count = 1_000_000
    message.points = message.points[:2]
    two = bytearray(serialize_message(message))
    # The second point has its padding, so it can be repeated; the length stands before the id of the first.
    head, point = two[:-32], np.frombuffer(two[-32:], dtype=np.uint8)
    place = head.rindex((2).to_bytes(4, "little") + message.points[0].id.to_bytes(4, "little"))
    head[place : place + 4] = count.to_bytes(4, "little")
    return bytes(head) + np.tile(point, count - 1).tobytes()


FEATURE_POINTS = [
    Cell(OFF, "no message", lambda lane: lane.run(10, detections=nothing), ("none",), NONE,
         note="`silent_publisher` or `no_detections` after 5 s"),
    Cell(STUCK, "the same pixels, stamps go on", fresh(lambda: {"detections": held(lambda m: m.points, copy_points)}, 45),
         ("OK", "NOT_TRUSTED"), NONE, says="camera or detector is stuck",
         note="refused `max_frozen_s` (0.5 s) after the first; until then the pose is that of the pixels"),
    Cell(STUCK, "the same stamp, pixels go on", fresh(lambda: {"detections": held(lambda m: m.header.stamp, copy_stamp)}, 10),
         ("OK", "ZERO_STAMP"), NONE, says="other detections with the stamp of the last", note="the first is right"),
    Cell(STUCK, "the same message again and again",
         lambda lane: lane.run(3, detections=held_message()), ("OK",), TRUE, note="each time the same pose"),
    Cell(GARBAGE, "pixel NaN", frames(3, set_points(u=math.nan)), ("NOT_FINITE",), NONE),
    Cell(GARBAGE, "pixel infinite", frames(3, set_points(v=-math.inf)), ("NOT_FINITE",), NONE),
    Cell(GARBAGE, "pixel 1e300", frames(3, set_points(u=1e300)), ("OUTSIDE_IMAGE",), NONE),
    Cell(GARBAGE, "sigma negative", frames(3, set_points(sigma=-0.5)), ("INVALID_SIGMA",), NONE),
    Cell(GARBAGE, "sigma NaN", frames(3, set_points(sigma=math.nan)), ("INVALID_SIGMA",), NONE),
    Cell(GARBAGE, "sigma infinite", frames(3, set_points(sigma=math.inf)), ("INVALID_SIGMA",), NONE),
    Cell(GARBAGE, "sigma 1e-300", frames(3, set_points(sigma=1e-300)), ("INVALID_SIGMA",), NONE),
    Cell(GARBAGE, "id not on the map", frames(3, set_points(id=4_294_967_295)), ("UNKNOWN_ID",), NONE),
    Cell(GARBAGE, "an id twice", frames(3, lambda m: m.points.append(m.points[0])), ("DUPLICATE_ID",), NONE),
    Cell(GARBAGE, "no point", frames(3, lambda m: setattr(m, "points", [])), ("TOO_FEW_POINTS",), NONE),
    Cell(GARBAGE, "10 000 points", frames(2, lambda m: setattr(m, "points", m.points * 1667)), ("DUPLICATE_ID",), NONE),
    Cell(GARBAGE, "1 000 000 points", lambda lane: lane.run(2, detections=million), ("none",), NONE,
         note="32 MB; best effort may lose it; the node goes on"),
    Cell(GARBAGE, "bytes cut off", lambda lane: lane.run(3, detections=undecodable), ("none",), NONE,
         fault=("undecodable", "cannot be decoded")),
    Cell(GARBAGE, "random bytes", lambda lane: lane.run(3, detections=noise), ("none",), NONE),
    Cell(GARBAGE, "`frame_id` of 5000 characters", frames(2, lambda m: setattr(m.header, "frame_id", "x" * 5000)),
         ("FRAME_MISMATCH",), NONE),
    Cell(GARBAGE, "stamp zero", frames(3, lambda m: setattr(m.header, "stamp", at(0))), ("ZERO_STAMP",), NONE),
    Cell(GARBAGE, "stamp negative", frames(3, lambda m: setattr(m.header, "stamp", at(-5))), ("ZERO_STAMP",), NONE),
    Cell(GARBAGE, "`nanosec` above 1e9", frames(3, lambda m: setattr(m.header.stamp, "nanosec", 4_000_000_000)),
         ("ZERO_STAMP",), NONE),
    Cell(WRONG, "one pixel off by 60 px", frames(5, shift(5, by_px=60.0)), ("OK", "NOT_TRUSTED"), TRUE,
         note="left out, or refused where it is not clear which is wrong"),
    Cell(WRONG, "two pixels off by 60 px", frames(5, shift(1, 5, by_px=60.0)), ("NOT_TRUSTED", "BEHIND_CAMERA", "NO_CONVERGENCE"), NONE),
    Cell(WRONG, "ids exchanged left to right", frames(5, exchange_sides), ("BEHIND_CAMERA", "NOT_TRUSTED"), NONE),
    Cell(WRONG, "all pixels off by 10 px", frames(5, shift(by_px=10.0)), ("OK", "NOT_TRUSTED"), WRONG_POSE,
         note="**not noticed**, as a wrong principal point: a tanker a little aside looks the same (of single frames off by 20 px 1 % pass, by 40 px 45 % without one marker); state it in the [error budget](budget.md)"),
    Cell(WRONG, "another camera's `frame_id`", frames(3, lambda m: setattr(m.header, "frame_id", "other")),
         ("FRAME_MISMATCH",), NONE),
    Cell(WRONG, "stamps an hour ahead", frames(5, later(3600)), ("OK",), TRUE, fault=("stamp_jump", "ahead by"),
         note="poses of their pixels, with the stamps that came; `clock_offset` after 2 s where clocks disagree"),
    Cell(SLOW, "one frame a second", lambda lane: lane.run(4, stride=50), ("OK",), TRUE),
    Cell(DELAYED, "the newest of six first", reversed_order, ("OK",), TRUE,
         note="each pose belongs to its own stamp"),
    Cell(INTERMITTENT, "every second frame missing", lambda lane: lane.run(10, detections=every(2, nothing)), ("OK",), TRUE),
    Cell(INTERMITTENT, "every second frame empty",
         lambda lane: lane.run(10, detections=every(2, spoilt(lambda m: setattr(m, "points", [])))),
         ("OK", "TOO_FEW_POINTS"), TRUE),
]


def box(**values: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        for name, value in values.items():
            setattr(message.detections[0].bbox.center.position, name, value)

    return change


VISION = [
    Cell(OFF, "no message", lambda lane: lane.run(10, detections=nothing), ("none",), NONE),
    Cell(STUCK, "the same boxes, stamps go on",
         fresh(lambda: {"detections": held(lambda m: m.detections, lambda m, d: setattr(m, "detections", d))}, 45),
         ("OK", "NOT_TRUSTED"), NONE, says="camera or detector is stuck"),
    Cell(GARBAGE, "centre NaN", frames(3, box(x=math.nan)), ("NOT_FINITE",), NONE),
    Cell(GARBAGE, "centre infinite", frames(3, box(y=math.inf)), ("NOT_FINITE",), NONE),
    Cell(GARBAGE, "`id` that is no number", frames(3, lambda m: setattr(m.detections[0], "id", "drogue\x1b[31m")),
         ("UNKNOWN_ID",), NONE),
    Cell(GARBAGE, "an id twice", frames(3, lambda m: m.detections.append(m.detections[0])), ("DUPLICATE_ID",), NONE),
    Cell(GARBAGE, "no box", frames(3, lambda m: setattr(m, "detections", [])), ("TOO_FEW_POINTS",), NONE),
    Cell(GARBAGE, "bytes cut off", lambda lane: lane.run(3, detections=undecodable), ("none",), NONE,
         fault=("undecodable", "cannot be decoded")),
    Cell(WRONG, "a box with the header of another image",
         frames(3, lambda m: setattr(m.detections[0].header, "frame_id", "other")), ("FRAME_MISMATCH",), NONE),
    Cell(INTERMITTENT, "every second frame missing", lambda lane: lane.run(10, detections=every(2, nothing)), ("OK",), TRUE),
]


def corner(x: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        message.detections[0].corners[0].x = x

    return change


APRILTAGS = [
    Cell(OFF, "no message", lambda lane: lane.run(10, detections=nothing), ("none",), NONE),
    Cell(STUCK, "the same corners, stamps go on",
         fresh(lambda: {"detections": held(lambda m: m.detections, lambda m, d: setattr(m, "detections", d))}, 45),
         ("OK", "NOT_TRUSTED"), NONE, says="camera or detector is stuck"),
    Cell(GARBAGE, "corner NaN", frames(3, corner(math.nan)), ("NOT_FINITE",), NONE),
    Cell(GARBAGE, "a tag twice", frames(3, lambda m: m.detections.append(m.detections[0])), ("DUPLICATE_ID",), NONE),
    Cell(GARBAGE, "negative tag", frames(3, lambda m: setattr(m.detections[0], "id", -1)), ("UNKNOWN_ID",), NONE),
    Cell(GARBAGE, "another family", frames(3, lambda m: setattr(m.detections[0], "family", "tag16h5")),
         ("UNKNOWN_ID",), NONE),
    Cell(WRONG, "corners in another order",
         frames(3, lambda m: setattr(m.detections[0], "corners", list(m.detections[0].corners)[::-1])),
         ("NOT_TRUSTED", "BEHIND_CAMERA", "NO_CONVERGENCE", "DEGENERATE_GEOMETRY"), NONE),
    Cell(INTERMITTENT, "every second frame missing", lambda lane: lane.run(10, detections=every(2, nothing)), ("OK",), TRUE),
]


def with_camera(change: Callable[[Any], object], count: int = 4) -> Callable[[Lane], list[Seen]]:
    return lambda lane: lane.run(count, camera=spoilt(change))


def scaled(factor: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        message.k[0] *= factor
        message.k[4] *= factor

    return change


def half_resolution(message: Any) -> None:
    message.width //= 2
    message.height //= 2
    message.k[0], message.k[2], message.k[4], message.k[5] = (message.k[i] / 2 for i in (0, 2, 4, 5))


CAMERA_INFO = [
    Cell(OFF, "no message", lambda lane: lane.run(5), ("OK",), TRUE,
         note="the last one stays valid; `stale_camera_info` after 5 s, `NO_CAMERA_INFO` where there never was one"),
    Cell(STUCK, "the same message again and again", lambda lane: lane.run(5, camera=lambda m, k: m), ("OK",), TRUE),
    Cell(GARBAGE, "K zero", with_camera(lambda m: setattr(m, "k", [0.0] * 9)), ("INVALID_CAMERA_INFO",), NONE),
    Cell(GARBAGE, "K NaN", with_camera(scaled(math.nan)), ("INVALID_CAMERA_INFO",), NONE),
    Cell(GARBAGE, "K infinite", with_camera(scaled(math.inf)), ("INVALID_CAMERA_INFO",), NONE),
    Cell(GARBAGE, "focal length negative", with_camera(scaled(-1.0)), ("INVALID_CAMERA_INFO",), NONE),
    Cell(GARBAGE, "D NaN", with_camera(lambda m: setattr(m, "d", [math.nan] * 5)), ("INVALID_CAMERA_INFO",), NONE),
    Cell(GARBAGE, "D of 100 000 numbers", with_camera(lambda m: setattr(m, "d", [0.0] * 100_000)),
         ("INVALID_CAMERA_INFO", "OK"), TRUE, note="refused, or lost by best effort"),
    Cell(GARBAGE, "unknown model", with_camera(lambda m: setattr(m, "distortion_model", "fisheye9")),
         ("INVALID_CAMERA_INFO",), NONE),
    Cell(GARBAGE, "width and height 0", with_camera(lambda m: (setattr(m, "width", 0), setattr(m, "height", 0))),
         ("OK",), TRUE, note="taken as not stated: pixels are not compared with the size of the image"),
    Cell(GARBAGE, "bytes cut off", lambda lane: lane.run(3, camera=undecodable), ("OK",), TRUE,
         fault=("undecodable", "camera_info cannot be decoded"), note="the last good one stays valid"),
    Cell(WRONG, "changes in flight to half the resolution", with_camera(half_resolution), ("NOT_TRUSTED",), NONE),
    Cell(WRONG, "changes in flight to another focal length (+30 %)", with_camera(scaled(1.3)), ("NOT_TRUSTED", "OK"), TRUE,
         note="poses of frames that overtake it are those of the camera before; one that fits without a marker is not believed"),
    Cell(WRONG, "changes in flight to another frame", with_camera(lambda m: setattr(m.header, "frame_id", "other")),
         ("FRAME_MISMATCH",), NONE),
    Cell(WRONG, "focal length off by 1 %", with_camera(scaled(1.01)), ("OK", "NOT_TRUSTED"), WRONG_POSE,
         note="**not noticed**: state the calibration's errors in the [error budget](budget.md)"),
    Cell(INTERMITTENT, "every second one unusable", lambda lane: lane.run(8, camera=every(2, spoilt(scaled(math.nan)))),
         ("OK", "INVALID_CAMERA_INFO"), TRUE),
]


# Frames between two images, so that no sample that belongs to one is near another: for the receiver and for the tanker.
APART, FAR_APART = 5, 20


def of_receiver(change: Callable[[Any], object], count: int = 8) -> Callable[[Lane], list[Seen]]:
    return lambda lane: lane.run(count, receiver=spoilt(change), stride=APART)


def move_px4(by_s: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        message.timestamp_sample += int(by_s * 1e6)

    return change


def set_q(*q: float) -> Callable[[Any], None]:
    return lambda message: setattr(message, "q", np.array(q, dtype=np.float32))


def product(a: Any, b: Any) -> Any:
    """Of quaternions (w, x, y, z)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


# FLU and FRD, and ENU and NED: half turns.
BODY = np.array([0.0, 1.0, 0.0, 0.0])
LOCAL = np.array([0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0])


def other_axes_px4(local: bool, body: bool) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        q = np.asarray(message.q, dtype=float)
        q = product(LOCAL, q) if local else q
        q = product(q, BODY) if body else q
        message.q = q.astype(np.float32)

    return change


def other_axes_imu(local: bool, body: bool) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        o = message.orientation
        q = np.array([o.w, o.x, o.y, o.z])
        q = product(LOCAL, q) if local else q
        q = product(q, BODY) if body else q
        o.w, o.x, o.y, o.z = (float(part) for part in q)
        if body:
            message.linear_acceleration.y *= -1.0
            message.linear_acceleration.z *= -1.0

    return change


UNUSABLE = ("unusable_attitude", "samples of the receiver's attitude are not used")
LOCAL_NONE = {"poses": TRUE, "local": NONE, "outcomes": ("OK",)}
LOCAL_TRUE = {"poses": TRUE, "local": TRUE, "outcomes": ("OK",)}

PX4_ATTITUDE = [
    Cell(OFF, "no message", lambda lane: lane.run(8, receiver=nothing, stride=APART), **LOCAL_NONE, recovers=2),
    Cell(STUCK, "the same message again and again",
         lambda lane: lane.run(8, receiver=held_message(), stride=FAR_APART), **LOCAL_NONE, recovers=2),
    Cell(STUCK, "the same attitude, stamps go on",
         fresh(lambda: {"receiver": held(lambda m: m.q, lambda m, q: setattr(m, "q", q))}, 8), **LOCAL_TRUE,
         note="**not noticed** by itself: wrong by what the aircraft has turned since; with the tanker's attitude see below"),
    Cell(GARBAGE, "quaternion zero", of_receiver(set_q(0, 0, 0, 0)), **LOCAL_NONE, fault=UNUSABLE, recovers=2),
    Cell(GARBAGE, "quaternion NaN", of_receiver(set_q(math.nan, 0, 0, 0)), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "quaternion infinite", of_receiver(set_q(math.inf, 0, 0, 0)), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "quaternion of length 2", of_receiver(set_q(2, 0, 0, 0)), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "stamp 0", of_receiver(lambda m: setattr(m, "timestamp_sample", 0)), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "stamp 2⁶⁴ − 1", of_receiver(lambda m: setattr(m, "timestamp_sample", 2**64 - 1)), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "bytes cut off", lambda lane: lane.run(8, receiver=undecodable, stride=APART), **LOCAL_NONE, recovers=2),
    Cell(WRONG, "NED from FLU", of_receiver(other_axes_px4(False, True)), **LOCAL_NONE, recovers=2,
         fault=("unusable_attitude", "does not fly the right way up")),
    Cell(WRONG, "ENU from FRD", of_receiver(other_axes_px4(True, False)), **LOCAL_NONE, recovers=2,
         fault=("unusable_attitude", "expected the rotation from FRD")),
    Cell(WRONG, "ENU from FLU", of_receiver(other_axes_px4(True, True)), poses=TRUE, local=WRONG_POSE, outcomes=("OK",),
         recovers=4,
         note="**not noticed** by itself: level flight stays level and has another heading, and this message has no "
         "accelerometer; with the tanker's attitude see below"),
    Cell(WRONG, "heading jumps", lambda lane: lane.run(
            8, receiver=every(2, spoilt(lambda m: setattr(m, "q", product([math.sqrt(0.5), 0, 0, math.sqrt(0.5)], m.q).astype(np.float32)))), stride=APART),
         **LOCAL_NONE, recovers=4, note="between two headings"),
    Cell(SLOW, "one sample in 0.4 s", lambda lane: lane.run(8, receiver=lambda m, k: m if k % 4 == 0 else None, stride=FAR_APART),
         **LOCAL_NONE, recovers=2, note="`attitude_max_age_s` (0.05 s) between two samples"),
    Cell(DELAYED, "0.2 s late", lambda lane: lane.run(8, receiver=spoilt(move_px4(-0.2)), stride=FAR_APART), **LOCAL_NONE,
         recovers=2),
    Cell(WRONG, "stamps 5 s ahead", of_receiver(move_px4(5.0)), **LOCAL_NONE, recovers=3),
    Cell(INTERMITTENT, "every second sample missing", lambda lane: lane.run(8, receiver=every(2, nothing)), **LOCAL_TRUE),
]


IMU_ATTITUDE = [
    Cell(OFF, "no message", lambda lane: lane.run(8, receiver=nothing, stride=APART), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "quaternion zero", of_receiver(lambda m: setattr(m.orientation, "w", math.nan)), **LOCAL_NONE, recovers=2,
         fault=UNUSABLE),
    Cell(GARBAGE, "rate NaN", of_receiver(lambda m: setattr(m.angular_velocity, "x", math.nan)), **LOCAL_NONE, recovers=2),
    Cell(GARBAGE, "marked as missing", of_receiver(lambda m: setattr(m, "orientation_covariance", [-1.0] * 9)), **LOCAL_NONE,
         recovers=2),
    Cell(GARBAGE, "accelerometer NaN", of_receiver(lambda m: setattr(m.linear_acceleration, "z", math.nan)), **LOCAL_TRUE,
         note="it is not used but to compare"),
    Cell(WRONG, "NED from FRD", of_receiver(other_axes_imu(True, True)), **LOCAL_NONE, recovers=2,
         fault=("unusable_attitude", "the accelerometer measures 9.")),
    Cell(WRONG, "ENU from FRD", of_receiver(other_axes_imu(False, True)), **LOCAL_NONE, recovers=2,
         fault=("unusable_attitude", "expected the rotation from FLU")),
    Cell(WRONG, "NED from FLU", of_receiver(other_axes_imu(True, False)), **LOCAL_NONE, recovers=2),
    Cell(INTERMITTENT, "every second sample missing", lambda lane: lane.run(8, receiver=every(2, nothing)), **LOCAL_TRUE),
]


def turned_left(deg: float) -> Callable[[Any], None]:
    """As of a compass that is off."""
    half = math.radians(deg) / 2

    def change(message: Any) -> None:
        o = message.orientation
        q = product([math.cos(half), 0.0, 0.0, math.sin(half)], [o.w, o.x, o.y, o.z])
        o.w, o.x, o.y, o.z = (float(part) for part in q)

    return change


def of_tanker(change: Callable[[Any], object], count: int = 6) -> Callable[[Lane], list[Seen]]:
    return lambda lane: lane.run(count, tanker=spoilt(change), stride=FAR_APART)


def silent_after_a_contradiction(lane: Lane) -> list[Seen]:
    lane.run(4, tanker=spoilt(turned_left(60.0)), stride=FAR_APART)
    return lane.run(6, tanker=nothing, stride=FAR_APART)


CONTRADICTION = ("attitude_contradiction", "one of the attitudes that both aircraft report is wrong")

TANKER_ATTITUDE = [
    Cell(OFF, "no message", lambda lane: lane.run(6, tanker=nothing, stride=FAR_APART), **LOCAL_TRUE, recovers=2,
         says="the tanker's attitude", note="the image alone"),
    Cell(STUCK, "the same message again and again", lambda lane: lane.run(6, tanker=held_message(), stride=FAR_APART),
         **LOCAL_TRUE, recovers=2, says="the tanker's attitude"),
    Cell(GARBAGE, "quaternion NaN", of_tanker(lambda m: setattr(m.orientation, "x", math.nan)), **LOCAL_TRUE,
         recovers=2, fault=("unusable_attitude", "samples of the tanker's attitude are not used")),
    Cell(GARBAGE, "bytes cut off", lambda lane: lane.run(6, tanker=undecodable, stride=FAR_APART), **LOCAL_TRUE, recovers=2),
    Cell(WRONG, "NED from FRD", of_tanker(other_axes_imu(True, True)), **LOCAL_TRUE, recovers=2,
         fault=("unusable_attitude", "the accelerometer measures 9.")),
    Cell(WRONG, "heading 60° off", of_tanker(turned_left(60.0)), **LOCAL_NONE, recovers=2, fault=CONTRADICTION,
         says="by both attitudes the tanker stands"),
    Cell(WRONG, "heading 60° off, then no message", silent_after_a_contradiction, **LOCAL_NONE, recovers=2,
         note="a contradiction does not end by silence"),
    Cell(WRONG, "heading 11° off", of_tanker(turned_left(11.0)), poses=NONE, local=NONE,
         outcomes=("NOT_TRUSTED",), says="what both aircraft report", recovers=2),
    Cell(WRONG, "the receiver's heading 60° off",
         lambda lane: lane.run(6, receiver=spoilt(turned_left(60.0)), stride=FAR_APART), **LOCAL_NONE, recovers=4, fault=CONTRADICTION,
         note="nothing tells which of the two is wrong"),
    Cell(WRONG, "the receiver's attitude ENU from FLU, no accelerometer",
         lambda lane: lane.run(6, receiver=without_accelerometer, stride=FAR_APART),
         poses=TRUE, local=NONE, outcomes=("OK", "NOT_TRUSTED"), recovers=2),
    Cell(SLOW, "one sample in 0.4 s", lambda lane: lane.run(6, tanker=lambda m, k: m if k % 4 == 0 else None, stride=FAR_APART),
         **LOCAL_TRUE, recovers=2),
    Cell(DELAYED, "0.3 s late",
         lambda lane: lane.run(6, tanker=spoilt(lambda m: moved(m, -300_000_000)), stride=40), **LOCAL_TRUE, recovers=2,
         says="older than the image"),
    Cell(INTERMITTENT, "every second sample missing", lambda lane: lane.run(6, tanker=every(2, nothing)), **LOCAL_TRUE),
]


def without_accelerometer(message: Any, _: int) -> Any:
    other_axes_imu(True, True)(message)
    message.linear_acceleration.x = message.linear_acceleration.y = message.linear_acceleration.z = 0.0
    return message


def moved(message: Any, by_ns: int) -> None:
    stamp = message.header.stamp
    total = stamp.sec * 1_000_000_000 + stamp.nanosec + by_ns
    message.header.stamp = at(*divmod(total, 1_000_000_000))


CLOCK = [
    Cell(OFF, "no message", lambda lane: lane.run(5, clock=nothing), ("OK",), TRUE, note="`no_clock` after 5 s"),
    Cell(STUCK, "the same time again and again", lambda lane: lane.run(5, clock=held_message()), ("OK",), TRUE),
    Cell(GARBAGE, "`nanosec` above 1e9",
         lambda lane: lane.run(5, clock=spoilt(lambda m: setattr(m.clock, "nanosec", 4_000_000_000))), ("OK",), TRUE),
    Cell(GARBAGE, "negative", lambda lane: lane.run(5, clock=spoilt(lambda m: setattr(m.clock, "sec", -2**31))), ("OK",), TRUE),
    Cell(GARBAGE, "bytes cut off", lambda lane: lane.run(5, clock=undecodable), ("OK",), TRUE),
    Cell(WRONG, "an hour ahead", lambda lane: lane.run(5, clock=spoilt(lambda m: setattr(m.clock, "sec", m.clock.sec + 3600))),
         ("OK",), TRUE, fault=("clock_jump", "ahead by")),
    Cell(INTERMITTENT, "every second message missing", lambda lane: lane.run(6, clock=every(2, nothing)), ("OK",), TRUE),
]
