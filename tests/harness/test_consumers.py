"""The whole way from pixels to flight stacks: their rules take all that a simulated approach sends, and the truth is in it."""

import copy
import itertools
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from mavros_msgs.msg import LandingTarget
from px4_msgs.msg import FiducialMarkerPosReport, LandingTargetPose, VehicleAttitude
from sensor_msgs.msg import Imu
from tanker_pose.msg import ReceptacleState

from harness import messages, sinks
from harness.approach import FRAMES, SETUP, STRIDE, Truth
from harness.conftest import StartEstimator, StartNode
from harness.estimator import Answer, Estimator

from harness.peer import BEST_EFFORT, Peer
from harness.processes import REPOSITORY, Process, example
from harness.rotations import from_quaternion, log
from harness.waiting import PATIENCE_S, wait_until

SIGMA_PX = 0.5
# Standard deviations: of a few thousand normal numbers none lies further out, one run in a thousand apart.
FARTHEST_SIGMAS = 5.0
# Frames before there is a track (confirm_frames: 5), and right ones that its gate may keep out of an approach: at one
# in ten thousand, three of two hundred are less likely than one in a million.
CONFIRMING = 4
GATED = 2

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


def all_on(attitude: str, px4: str) -> list[str]:
    arguments = ["-p", f"refuelling:={SETUP}", "-p", f"attitude:={attitude}"]
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
        start: StartEstimator,
        rng: np.random.Generator,
        attitude: str = "px4",
        px4: str = "px4_landing_target",
        *more: str,
    ) -> None:
        self.peer = peer
        self.rng = rng
        self.outputs = outputs_with(px4)
        self.heard = {name: peer.collect(*TOPICS[name]) for name in self.outputs}
        self.diagnostics: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
        message_type, topic, self._tell = ATTITUDES[attitude]
        self._attitudes = peer.node.create_publisher(message_type, topic, BEST_EFFORT)
        self._attitude_topic = topic
        self._told = itertools.count(-50 * STRIDE)
        self._next_attitude = next(self._told)
        self.estimator: Estimator = start(*all_on(attitude, px4), *more)
        self.estimator.use_camera()

    def tell_attitudes(self, up_to: int) -> None:
        """Sends all attitudes up to an index."""
        while self._next_attitude <= up_to:
            self._attitudes.publish(self._tell(Truth(self._next_attitude)))
            self._next_attitude = next(self._told)

    def frame(self, index: int) -> Answer:
        """Sends the image of an index; without lead the attitude would not be there in time."""
        truth = Truth(index)
        frame = messages.noisy_frame(index, truth.camera_from_tanker, self.rng, sigma_px=SIGMA_PX)
        return self.estimator.ask(frame)

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


def within(found: Any, truth: Any, variances: Any) -> None:
    """Asserts that an error fits its variances."""
    error = np.abs(np.asarray(found, dtype=float) - np.asarray(truth))
    sigmas = np.sqrt(np.asarray(variances, dtype=float))
    assert np.all(error < FARTHEST_SIGMAS * sigmas), f"{error} with sigmas {sigmas}"


def vector(v: Any) -> list[float]:
    return [v.x, v.y, v.z]


@pytest.mark.parametrize("attitude, px4", [*zip(ATTITUDES, PX4_OUTPUTS, strict=True)])
def test_a_whole_approach_is_taken_by_every_sink_and_true(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator, attitude: str, px4: str
) -> None:
    flight = Flight(peer, start_estimator, rng, attitude, px4)
    flight.warm_up()

    good = flight.fly()

    assert len(good) > 0.9 * FRAMES
    mavros_pose = sinks.MavrosPose()
    rules: dict[str, sinks.Sink] = {
        "px4_landing_target": sinks.px4_landing_target,
        "px4_fiducial_marker": sinks.px4_fiducial_marker,
        "mavros_landing_target": sinks.mavros_landing_target,
        "mavros_pose": mavros_pose,
    }
    for name, rule in rules.items():
        if name not in flight.outputs:
            continue
        told = flight.messages_of(name, good)
        missing = set(good) - set(told)
        if name == "px4_landing_target":
            missing -= set(good[:CONFIRMING])
        assert len(missing) <= (GATED if name == "px4_landing_target" else 0), (name, missing)
        for index, message in told.items():
            # PX4's clock when it reads the message, 20 ms after the image.
            assert rule(message, Truth(index).stamp_us + 20_000) == [], (name, index)

    if px4 == "px4_landing_target":
        for index, message in flight.messages_of("px4_landing_target", good).items():
            truth = Truth(index)
            m = message
            of_position = [m.cov_x_rel, m.cov_y_rel, m.cov_z_rel]
            of_velocity = [m.cov_vx_rel, m.cov_vy_rel, m.cov_vz_rel]
            within([m.x_rel, m.y_rel, m.z_rel], truth.in_ned, of_position)
            within([m.vx_rel, m.vy_rel, m.vz_rel], truth.rate_of("in_ned"), of_velocity)
        return
    reports = flight.messages_of("px4_fiducial_marker", good)
    for index, message in reports.items():
        truth = Truth(index)
        w, x, y, z = (float(q) for q in message.q)
        assert np.linalg.norm(log(from_quaternion(x, y, z, w) @ truth.ned_from_frd.T)) < 1e-5
        within(message.rel_pos, truth.in_frd, message.cov_rel_pos)
    # MAVROS's messages bring no variances.
    variances = {index: message.cov_rel_pos for index, message in reports.items()}
    for index, message in flight.messages_of("mavros_landing_target", good).items():
        position, rotation = sinks.through_mavros(message.pose)
        within(position, Truth(index).in_frd, variances[index])
        assert message.header.frame_id == "receiver"
        in_frd = sinks.FRD_FROM_FLU @ _tanker_attitude(index) @ sinks.FRD_FROM_FLU
        assert np.linalg.norm(log(rotation @ in_frd.T)) < np.radians(10.0)
    for index, message in flight.messages_of("mavros_pose", good).items():
        truth = Truth(index)
        position, rotation = sinks.through_mavros(message.pose)
        within(truth.ned_from_frd.T @ position, truth.in_frd, variances[index])
        in_ned = truth.ned_from_frd @ (
            sinks.FRD_FROM_FLU @ _tanker_attitude(index) @ sinks.FRD_FROM_FLU
        )
        assert np.linalg.norm(log(rotation @ in_ned.T)) < np.radians(10.0)
        assert message.header.frame_id == "receiver_enu"


def _tanker_attitude(index: int) -> Any:
    """receiver_from_tanker."""
    from harness import paper

    return paper.CAMERA_FROM_RECEIVER.T @ Truth(index).camera_from_tanker.rotation


def test_the_receptacle_is_told_before_the_probe_with_speed_and_envelope(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator
) -> None:
    flight = Flight(peer, start_estimator, rng)
    flight.warm_up()

    good = flight.fly()

    told = flight.messages_of("receptacle", good)
    assert len(set(good[CONFIRMING:]) - set(told)) <= GATED
    for index, message in told.items():
        truth = Truth(index)
        covariance = np.array(message.covariance).reshape(6, 6)
        assert np.linalg.eigvalsh(covariance).min() > 0
        found = np.array(vector(message.position) + vector(message.velocity))
        expected = np.concatenate([truth.from_probe, truth.rate_of("from_probe")])
        within(found, expected, covariance.diagonal())
        assert message.header.stamp == messages.stamp_of(index)
        assert message.header.frame_id == "receiver"
        assert message.distance == pytest.approx(np.linalg.norm(found[:3]))
        assert message.distance_ahead == pytest.approx(found[0])
        assert message.closing_speed == pytest.approx(-found[3])
        assert message.distance_ahead_sigma == pytest.approx(np.sqrt(covariance[0, 0]))
        assert message.closing_speed_sigma == pytest.approx(np.sqrt(covariance[3, 3]))
        probabilities = [
            message.probability_outside,
            message.probability_pre_contact,
            message.probability_contact,
        ]
        assert sum(probabilities) == pytest.approx(1.0)
        assert min(probabilities) >= 0.0
    first, last = told[min(told)], told[max(told)]
    assert first.envelope == ReceptacleState.ENVELOPE_OUTSIDE
    assert first.probability_outside > 0.99
    assert last.envelope == ReceptacleState.ENVELOPE_PRE_CONTACT
    assert last.probability_pre_contact > 0.9
    assert last.closing_speed == pytest.approx(1.5, abs=FARTHEST_SIGMAS * last.closing_speed_sigma)


# What goes wrong between a camera and an autopilot, one at a time.
def _nan(values: Any) -> Any:
    return [float("nan")] * len(values)


FAULTS: dict[str, list[tuple[str, Callable[[Any], None]]]] = {
    "px4_fiducial_marker": [
        ("time not set", lambda m: setattr(m, "timestamp_sample", 0)),
        ("time of PX4's start, not of ROS", lambda m: setattr(m, "timestamp_sample", 10_000_000)),
        ("time of the future", lambda m: setattr(m, "timestamp_sample", m.timestamp + 60_000_000)),
        ("NaN position", lambda m: setattr(m, "rel_pos", _nan(m.rel_pos))),
        ("zero variance", lambda m: setattr(m, "cov_rel_pos", [0.0] * 3)),
        ("negative variance", lambda m: setattr(m, "cov_rel_pos", [0.1, -0.1, 0.1])),
        ("NaN variance", lambda m: setattr(m, "cov_rel_pos", _nan(m.cov_rel_pos))),
        ("no quaternion", lambda m: setattr(m, "q", [0.0] * 4)),
        ("NaN quaternion", lambda m: setattr(m, "q", _nan(m.q))),
    ],
    "px4_landing_target": [
        ("time not set", lambda m: setattr(m, "timestamp", 0)),
        ("old", lambda m: setattr(m, "timestamp", m.timestamp - 5_000_000)),
        ("position not valid", lambda m: setattr(m, "rel_pos_valid", False)),
        ("velocity not valid", lambda m: setattr(m, "rel_vel_valid", False)),
        ("tanker as ground", lambda m: setattr(m, "is_static", True)),
        ("tanker's speed as own", lambda m: setattr(m, "rel_vel_ekf2_valid", True)),
        ("absolute position made up", lambda m: setattr(m, "abs_pos_valid", True)),
        ("NaN position", lambda m: setattr(m, "z_rel", float("nan"))),
        ("infinite velocity", lambda m: setattr(m, "vx_rel", float("inf"))),
        ("zero variance", lambda m: setattr(m, "cov_vy_rel", 0.0)),
    ],
    "mavros_landing_target": [
        ("stamp zero", lambda m: setattr(m.header, "stamp", type(m.header.stamp)())),
        ("MAV_FRAME_LOCAL_NED", lambda m: setattr(m, "frame", 1)),
        ("MAV_FRAME_BODY_NED", lambda m: setattr(m, "frame", 8)),
        ("no distance", lambda m: setattr(m, "distance", 0.0)),
        ("negative distance", lambda m: setattr(m, "distance", -m.distance)),
        ("distance of another target", lambda m: setattr(m, "distance", m.distance * 1.1)),
        ("NaN position", lambda m: setattr(m.pose.position, "x", float("nan"))),
        ("no quaternion", lambda m: setattr(m.pose, "orientation", type(m.pose.orientation)(w=0.0))),
        ("NaN angle", lambda m: setattr(m, "angle", _nan(m.angle))),
    ],
    "mavros_pose": [
        ("stamp zero", lambda m: setattr(m.header, "stamp", type(m.header.stamp)())),
        ("no frame", lambda m: setattr(m.header, "frame_id", "")),
        ("NaN position", lambda m: setattr(m.pose.position, "y", float("nan"))),
        ("infinite position", lambda m: setattr(m.pose.position, "y", float("inf"))),
        ("quaternion of length 2", lambda m: setattr(m.pose.orientation, "w", 2.0)),
    ],
}


@pytest.mark.parametrize("px4", PX4_OUTPUTS)
def test_the_sinks_refuse_every_seeded_fault(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator, px4: str
) -> None:
    flight = Flight(peer, start_estimator, rng, "px4", px4)
    flight.warm_up()
    good = flight.fly(10)
    now_us = Truth(good[-1]).stamp_us + 20_000
    for name, faults in FAULTS.items():
        if name not in flight.outputs:
            continue
        message = flight.messages_of(name, good)[good[-1]]

        def refused(message: Any, name: str = name) -> list[str]:
            rule = sinks.MavrosPose() if name == "mavros_pose" else getattr(sinks, name)
            return rule(message, now_us)

        assert refused(message) == []
        for fault, spoil in faults:
            spoilt = copy.deepcopy(message)
            spoil(spoilt)
            assert refused(spoilt), f"{name} is taken with {fault}"
    twice = sinks.MavrosPose()
    pose = flight.messages_of("mavros_pose", good)[good[-1]]
    assert twice(pose, now_us) == []
    assert twice(pose, now_us), "the same stamp again"
    for mav_frame in (sinks.LOCAL_NED, 8, 12, 20):
        assert sinks.MavrosPose(mav_frame)(pose, now_us), f"through MAVROS as frame {mav_frame}"


@pytest.mark.parametrize("px4", PX4_OUTPUTS)
def test_without_the_attitude_of_the_image_nothing_in_ned_is_told_and_the_reason_is(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator, px4: str
) -> None:
    flight = Flight(peer, start_estimator, rng, "px4", px4)
    flight.warm_up()
    good = flight.fly(10)
    before = {name: len(flight.messages_of(name, good)) for name in flight.outputs}

    # The attitude falls silent; half a second later it is too old.
    later = range((10 + 7) * STRIDE, (10 + 27) * STRIDE, STRIDE)
    answers = {index: flight.frame(index).outcome for index in later}
    good_later = [index for index, outcome in answers.items() if outcome == "OK"]
    assert good_later

    told = flight.messages_of("mavros_landing_target", good_later)
    assert set(told) == set(good_later), "BODY_FRD needs no attitude"
    stamps = {Truth(index).stamp_us for index in good_later}
    for name in (px4, "mavros_pose"):
        assert not [m for m in flight.heard[name] if stamp_us(m) in stamps], name
        assert before[name] > 0
    peer.spin_until(
        lambda: any("older than the image" in said for said, _ in flight.consumers_said()),
        "the reason in diagnostics",
    )
    assert "older than the image" in flight.estimator.process.log
    said, values = [
        (said, values) for said, values in flight.consumers_said() if "older than" in said
    ][-1]
    assert "/mavros/landing_target/pose" in said
    assert int(values["/mavros/landing_target/pose.silent"]) > 0
    assert int(values["/mavros/landing_target/raw.silent"]) == 0


def test_an_attitude_that_is_none_is_not_used(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator
) -> None:
    flight = Flight(peer, start_estimator, rng)
    flight.warm_up()
    good = flight.fly(5)
    flight.messages_of("mavros_pose", good)

    spoilt = Truth(0).vehicle_attitude
    spoilt.q = [0.0, 0.0, 0.0, 0.0]
    spoilt.timestamp_sample = Truth(8 * STRIDE).stamp_us
    flight._attitudes.publish(spoilt)

    peer.spin_until(
        lambda: "a sample of the receiver's attitude is not used" in flight.estimator.process.log,
        "the warning of a quaternion that is none",
    )
    assert "length 0" in flight.estimator.process.log


def test_nothing_of_it_is_opened_unless_asked_for(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    start_estimator()

    for _, topic in TOPICS.values():
        assert peer.node.count_publishers(topic) == 0
    for _, topic, _ in ATTITUDES.values():
        assert peer.node.count_subscribers(topic) == 0


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["publish_receptacle:=true"], 'publish_receptacle needs the parameter "refuelling"'),
        (
            ["publish_mavros_pose:=true", f"refuelling:={SETUP}"],
            'publish_mavros_pose needs the parameter "attitude"',
        ),
        (["publish_receptacle:=true", "refuelling:=nowhere.yaml"], "cannot read"),
        (
            ["publish_receptacle:=true", f"refuelling:={SETUP}", "track:=false"],
            "publish_receptacle comes from the track",
        ),
        (
            [
                *("publish_px4_landing_target:=true", "publish_px4_fiducial_marker:=true"),
                *(f"refuelling:={SETUP}", "attitude:=px4"),
            ],
            "publish_px4_landing_target and publish_px4_fiducial_marker exclude each other",
        ),
        (
            [
                "publish_receptacle:=true",
                f"refuelling:={REPOSITORY / 'config' / 'tankers' / 'paper.yaml'}",
            ],
            "paper.yaml:",
        ),
    ],
)
def test_outputs_that_cannot_be_stop_the_node_at_once(
    start_node: StartNode, arguments: list[str], said: str
) -> None:
    node = start_node(*[word for argument in arguments for word in ("-p", argument)])

    assert node.wait() != 0
    assert said in node.log
    assert "panicked" not in node.log


def test_the_examples_print_distance_and_closing_speed(
    peer: Peer,
    start_estimator: StartEstimator,
    rng: np.random.Generator,
    domain: int,
    tmp_path: Any,
) -> None:
    flight = Flight(peer, start_estimator, rng)
    flight.warm_up()
    python = REPOSITORY / "examples" / "closing_speed.py"
    commands = {
        "rust": [str(example("closing_speed")), "3"],
        "python": [sys.executable, str(python), "3"],
    }
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    running = {
        name: Process(command, domain, tmp_path / name, environment)
        for name, command in commands.items()
    }
    try:
        indices = iter(range(0, FRAMES * STRIDE, STRIDE))

        def fly_on() -> None:
            index = next(indices)
            flight.tell_attitudes(index + 2 * STRIDE)
            flight.frame(index)
            peer.spin_for(0.1)

        wait_until(
            lambda: not any(process.running for process in running.values()),
            "both examples to print three lines",
            timeout_s=2 * PATIENCE_S,
            pause=fly_on,
        )
        for name, process in running.items():
            assert process.wait() == 0, process.log
            lines = process.log.splitlines()
            assert len(lines) == 3, f"{name}: {process.log}"
            for line in lines:
                assert "closing" in line and "m/s" in line and "outside" in line, line
    finally:
        for process in running.values():
            process.kill_if_running()
