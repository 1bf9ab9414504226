"""The whole way from pixels to flight stacks: their rules take all that a simulated approach sends, and the truth is in it."""

import copy
import itertools
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tanker_pose.msg import ReceptacleState

from harness import approach, comparison, messages, sinks
from harness.approach import FRAMES, SETUP, STRIDE, Truth, exact_setup
from harness.conftest import StartEstimator, StartNode
from harness.flight_stacks import ATTITUDES, PX4_OUTPUTS, TOPICS, Flight, stamp_us
from harness.peer import Peer
from harness.processes import REPOSITORY, Process, example
from harness.rotations import about_z
from harness.waiting import PATIENCE_S, wait_until

# Standard deviations: of a few thousand normal numbers none lies further out, one run in a thousand apart.
FARTHEST_SIGMAS = 5.0
# Samples of a position for each probability.
SAMPLES = 50_000
# Frames before there is a track (confirm_frames: 5), and right ones that its gate may keep out of an approach: at one
# in ten thousand, three of two hundred are less likely than one in a million.
CONFIRMING = 4
GATED = 2

# Nothing of the attitude's own in the covariances, since the truth has no error of it, and a track that knows how
# straight the flight is: sigmas are small then, and small faults show.
EXACT_FLIGHT = (
    *("-p", "attitude_sigma_deg:=0.001"),
    *("-p", "attitude_rate_sigma_dps:=0.001"),
    *("-p", "acceleration_density_mps2:=0.02"),
    *("-p", "angular_acceleration_density_dps2:=0.5"),
)


@pytest.mark.parametrize("px4", PX4_OUTPUTS)
@pytest.mark.parametrize("attitude", ATTITUDES)
def test_a_whole_approach_is_taken_by_every_sink_and_true(
    peer: Peer,
    start_estimator: StartEstimator,
    rng: np.random.Generator,
    tmp_path: Path,
    attitude: str,
    px4: str,
) -> None:
    flight = Flight(
        peer, start_estimator, rng, attitude, px4, exact_setup(tmp_path), *EXACT_FLIGHT
    )
    flight.warm_up()

    good = flight.fly()

    assert len(good) > 0.9 * FRAMES
    rules: dict[str, sinks.Sink] = {
        "px4_landing_target": sinks.px4_landing_target,
        "px4_fiducial_marker": sinks.px4_fiducial_marker,
        "mavros_landing_target": sinks.mavros_landing_target,
        "mavros_pose": sinks.MavrosPose(),
    }
    for name in flight.outputs:
        told = flight.messages_of(name, good)
        missing = set(good) - set(told)
        of_track = name in comparison.OF_TRACK
        if of_track:
            missing -= set(good[:CONFIRMING])
        assert len(missing) <= (GATED if of_track else 0), (name, missing)
        if name in rules:
            for index, message in told.items():
                # PX4's clock when it reads the message, 20 ms after the image.
                assert rules[name](message, Truth(index).stamp_us + 20_000) == [], (name, index)

        assert comparison.judge(name, told, flight.poses) == [], name
        for fault, spoil in comparison.FAULTS[name]:
            spoilt = {index: copy.deepcopy(message) for index, message in told.items()}
            for index, message in spoilt.items():
                spoil(Truth(index), message)
            assert comparison.judge(name, spoilt, flight.poses), f"{name} is true with {fault}"

    frames = {
        name: {message.header.frame_id for message in flight.messages_of(name, good).values()}
        for name in ("receptacle", "mavros_landing_target", "mavros_pose")
    }
    assert list(frames.values()) == [{"receiver"}, {"receiver"}, {"receiver_enu"}]


def sampled_probabilities(message: ReceptacleState, rng: np.random.Generator) -> list[float]:
    """Outside, pre-contact and contact by counting samples of the position's distribution."""
    covariance = np.array(message.covariance).reshape(6, 6)[:3, :3]
    mean = [message.position.x, message.position.y, message.position.z]
    samples = rng.multivariate_normal(mean, covariance, SAMPLES)
    x, off_axis = samples[:, 0], np.hypot(samples[:, 1], samples[:, 2])
    contact = (
        (x >= approach.CONTACT_FROM_X)
        & (x <= approach.CONTACT_TO_X)
        & (off_axis <= approach.CONTACT_RADIUS)
    )
    low, high = approach.PRE_CONTACT
    inside = np.all((samples >= low) & (samples <= high), axis=1)
    return [float(np.mean(kind)) for kind in (~inside, inside & ~contact, contact)]


def test_the_receptacle_is_told_through_all_of_the_envelope_up_to_contact(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator
) -> None:
    flight = Flight(peer, start_estimator, rng)
    flight.warm_up()

    good = flight.fly()

    told = flight.messages_of("receptacle", good)
    assert len(set(good[CONFIRMING:]) - set(told)) <= GATED
    for index, message in told.items():
        covariance = np.array(message.covariance).reshape(6, 6)
        assert np.linalg.eigvalsh(covariance).min() > 0
        position = np.array([message.position.x, message.position.y, message.position.z])
        assert message.header.stamp == messages.stamp_of(index)
        assert message.header.frame_id == "receiver"
        assert message.distance == pytest.approx(np.linalg.norm(position))
        assert message.distance_ahead == pytest.approx(position[0])
        assert message.closing_speed == pytest.approx(-message.velocity.x)
        assert message.distance_ahead_sigma == pytest.approx(np.sqrt(covariance[0, 0]))
        assert message.closing_speed_sigma == pytest.approx(np.sqrt(covariance[3, 3]))
        found = [
            message.probability_outside,
            message.probability_pre_contact,
            message.probability_contact,
        ]
        assert sum(found) == pytest.approx(1.0)
        for probability, share in zip(found, sampled_probabilities(message, rng), strict=True):
            assert 0.0 <= probability <= 1.0
            scatter = np.sqrt(probability * (1 - probability) / SAMPLES)
            # Of rare samples a handful more or less says nothing.
            tolerance = FARTHEST_SIGMAS * scatter + 10 / SAMPLES
            assert share == pytest.approx(probability, abs=tolerance), index
    states = [(index, told[index].envelope) for index in sorted(told)]
    order = [state for state, _ in itertools.groupby(state for _, state in states)]
    assert order[0] == ReceptacleState.ENVELOPE_OUTSIDE
    assert order[-1] == ReceptacleState.ENVELOPE_CONTACT
    assert set(order) == {
        ReceptacleState.ENVELOPE_OUTSIDE,
        ReceptacleState.ENVELOPE_PRE_CONTACT,
        ReceptacleState.ENVELOPE_CONTACT,
    }
    assert max(message.probability_pre_contact for message in told.values()) > 0.99
    first, last = told[min(told)], told[max(told)]
    assert first.probability_outside > 0.99
    assert last.probability_contact > 0.99


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
        lambda: "samples of the receiver's attitude are not used" in flight.estimator.process.log,
        "the warning of a quaternion that is none",
    )
    assert "length 0" in flight.estimator.process.log


def test_an_attitude_that_px4_has_reset_is_never_mixed_with_the_one_before(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator
) -> None:
    flight = Flight(peer, start_estimator, rng)
    flight.warm_up()
    good = flight.fly(10)
    flight.messages_of("mavros_pose", good)
    # Ten degrees in 20 ms are 8.7 rad/s: the counter has to tell that this is no turn.
    heading = about_z(np.radians(10.0))
    first = flight._next_attitude

    def tell(*indices: int) -> None:
        for index in indices:
            flight._attitudes.publish(Truth(index).vehicle_attitude_with(heading, resets=1))

    def silent(index: int) -> bool:
        assert flight.frame(index).outcome == "OK"
        flight.messages_of("mavros_landing_target", [index])
        stamp = Truth(index).stamp_us
        return not [m for m in flight.heard["mavros_pose"] if stamp_us(m) == stamp]

    # Half way between the last sample before the reset and the first one after it.
    tell(first)
    peer.spin_for(0.2)
    assert silent(first - 1), "between two headings"
    assert silent(first), "one sample after the reset makes no rate"
    peer.spin_until(
        lambda: any("attitude, got 1" in said for said, _ in flight.consumers_said()),
        "the reason in diagnostics",
    )

    tell(first + 1, first + 2)
    peer.spin_for(0.2)
    assert flight.frame(first + 1).outcome == "OK"
    message = flight.messages_of("mavros_pose", [first + 1])[first + 1]
    truth = Truth(first + 1)
    position, _ = sinks.through_mavros(message.pose)
    # m; a fifth of what the heading moves it by.
    moved = np.linalg.norm(heading @ truth.in_ned - truth.in_ned)
    assert np.linalg.norm(position - heading @ truth.in_ned) < 0.2 * moved


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
        (
            ["reported_attitude_sigma_deg:=2.0"],
            'reported_attitude_sigma_deg above 0 needs the parameter "attitude"',
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


# What both examples print of a message.
PRINTED = re.compile(
    r"distance +(?P<distance>\S+) m  closing +(?P<closing>\S+) m/s ±(?P<sigma>\S+)  (?P<envelope>.+) "
    r"\(contact (?P<contact>\S+) %\)"
)
# m and m/s: half of the last digit printed.
PRINTED_ROUNDING = 5.1e-4


def test_the_examples_print_the_true_distance_and_closing_speed(
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
        told = {
            index: message
            for index in range(0, FRAMES * STRIDE, STRIDE)
            for message in flight.heard["receptacle"]
            if message.header.stamp == messages.stamp_of(index)
        }
        for name, process in running.items():
            assert process.wait() == 0, process.log
            # On a slow machine they may have said that nothing comes yet.
            lines = [line for line in process.log.splitlines() if not line.startswith("nothing on")]
            assert len(lines) == 3, f"{name}: {process.log}"
            last = -1
            for line in lines:
                printed = PRINTED.fullmatch(line)
                assert printed, f"{name}: {line}"
                distance, closing, sigma = (
                    float(printed[value]) for value in ("distance", "closing", "sigma")
                )
                (index, message) = next(
                    (index, told[index])
                    for index in sorted(told)
                    if index > last and abs(told[index].distance - distance) < PRINTED_ROUNDING
                )
                last = index
                truth = Truth(index)
                ahead = truth.from_probe / np.linalg.norm(truth.from_probe)
                covariance = np.array(message.covariance).reshape(6, 6)[:3, :3]
                sigma_m = float(np.sqrt(ahead @ covariance @ ahead))
                true_distance = np.linalg.norm(truth.from_probe)
                assert abs(distance - true_distance) < FARTHEST_SIGMAS * sigma_m + PRINTED_ROUNDING
                assert sigma == pytest.approx(message.closing_speed_sigma, abs=PRINTED_ROUNDING)
                true_closing = -truth.rate_of("from_probe")[0]
                assert abs(closing - true_closing) < FARTHEST_SIGMAS * sigma + PRINTED_ROUNDING
                # An approach, not a retreat, and said with more than its doubt.
                assert closing > 0.5 > 2 * sigma, line
                assert printed["envelope"] == "outside" and float(printed["contact"]) == 0.0
    finally:
        for process in running.values():
            process.kill_if_running()
