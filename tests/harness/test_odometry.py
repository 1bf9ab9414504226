"""The track: odometry for every frame once it is confirmed, and what it makes of frames that do not fit."""

from pathlib import Path

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rosbags.rosbag2 import StoragePlugin
from std_srvs.srv import Trigger
from tanker_pose.msg import EstimatorStatus, FeaturePointArray

from harness import messages, paper
from harness.bags import approach, write_approach_bag
from harness.conftest import StartEstimator
from harness.consistency import mean_nees_bounds, nees
from harness.estimator import Answer, Estimator
from harness.messages import FRAME_PERIOD_NS, key, pose_of
from harness.peer import Peer
from harness.rotations import Array, Pose, log
from harness.test_bags import play
from harness.test_parameter_services import Client

CONFIRM_FRAMES = 5
PERIOD_S = FRAME_PERIOD_NS * 1e-9
# The frame that is first beyond max_gap_s after the last good one.
BEYOND_GAP = round(1.0 / PERIOD_S) + 1

TRACKS: dict[int, str] = {
    value: name.removeprefix("TRACK_")
    for name, value in type(EstimatorStatus).__prepare__("EstimatorStatus", ()).items()
    if name.startswith("TRACK_")
}
WITH_ODOMETRY = {"UPDATED", "PREDICTED", "GATED"}


def flight(time_s: float) -> Pose:
    """30 m to 15 m in ten seconds, rocking by 2°: smooth, and none of the filter's own making."""
    swing = 2.0 * np.sin(time_s * np.array([0.6, 0.8, 1.1]))
    range_m = 30.0 - 1.5 * time_s
    return paper.camera_from_tanker(*swing, (range_m, 0.3 * np.sin(0.5 * time_s), 0.3 * range_m))


def true_twist(time_s: float) -> Array:
    """Velocity and rate of the tanker in the camera, in the tanker's axes."""
    step = 1e-4
    before, at, after = flight(time_s - step), flight(time_s), flight(time_s + step)
    velocity = (after.translation - before.translation) / (2 * step)
    rate = log(after.rotation @ before.rotation.T) / (2 * step)
    return np.concatenate([at.rotation.T @ velocity, at.rotation.T @ rate])


def twist_of(message: Odometry) -> Array:
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    return np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])


def sigmas(message: Odometry) -> Array:
    """Standard deviations of the pose."""
    return np.sqrt(np.diag(np.array(message.pose.covariance).reshape(6, 6)))


class Flyer:
    """An estimator with an ear for odometry, and a tanker that moves with the stamps."""

    def __init__(self, estimator: Estimator, odometry: list[Odometry]) -> None:
        self.estimator = estimator
        self.odometry = odometry
        self._first = estimator.next_index()
        self._next = self._first

    def time_of(self, index: int) -> float:
        return (index - self._first) * PERIOD_S

    def next_index(self, skip: int = 0) -> int:
        index = self._next + skip
        self._next = index + 1
        return index

    def frame(self, index: int, rng: np.random.Generator | None = None) -> FeaturePointArray:
        pose = flight(self.time_of(index))
        if rng is None:
            return messages.exact_frame(index, pose)
        return messages.noisy_frame(index, pose, rng)

    def spoilt(self, index: int) -> FeaturePointArray:
        """A frame that gives no pose."""
        frame = self.frame(index)
        frame.points[0].id = 99
        return frame

    def ask(self, frame: FeaturePointArray) -> tuple[Answer, str, Odometry | None]:
        """Sends a frame; returns its answer, its track in a word, its odometry when that is promised."""
        answer = self.estimator.ask(frame)
        track = TRACKS[answer.status.track]
        if track not in WITH_ODOMETRY:
            return answer, track, None
        stamp = key(frame.header.stamp)
        self.estimator.peer.spin_until(lambda: self.of(stamp) != [], f"odometry for {stamp}")
        return answer, track, self.of(stamp)[-1]

    def of(self, stamp: tuple[int, int]) -> list[Odometry]:
        return [message for message in self.odometry if key(message.header.stamp) == stamp]

    def confirm(self) -> int:
        """Flies until there is a track; returns the last index."""
        for _ in range(CONFIRM_FRAMES):
            index = self.next_index()
            _, track, _ = self.ask(self.frame(index))
        assert track == "UPDATED"
        return index


@pytest.fixture
def flyer(start_estimator: StartEstimator, peer: Peer) -> Flyer:
    odometry: list[Odometry] = peer.collect(Odometry, "/odometry")
    estimator = start_estimator()
    estimator.use_camera()
    return Flyer(estimator, odometry)


def test_every_frame_of_an_approach_has_honest_odometry_once_the_track_is_confirmed(
    flyer: Flyer, rng: np.random.Generator
) -> None:
    frames, settled = 450, 100
    pose_nees, twist_nees, twist_errors = [], [], []
    refused = 0
    for k in range(frames):
        index = flyer.next_index()
        frame = flyer.frame(index, rng)
        answer, track, message = flyer.ask(frame)
        if k < CONFIRM_FRAMES - 1:
            assert track == "CANDIDATE"
            continue
        # Far away a frame may be refused as ambiguous; one correct frame in ten thousand is gated, and one in a
        # thousand fails the chi-squared test.
        assert (answer.outcome, track) in (
            ("OK", "UPDATED"),
            ("OK", "GATED"),
            ("AMBIGUOUS", "PREDICTED"),
            ("NOT_TRUSTED", "PREDICTED"),
        )
        refused += answer.outcome == "NOT_TRUSTED"
        assert message is not None
        assert message.header == frame.header
        assert message.child_frame_id == "tanker"
        if k < settled:
            continue
        error = true_twist(flyer.time_of(index)) - twist_of(message)
        twist_errors.append(error)
        # Errors of neighbours are alike: one a second counts.
        if (k - settled) % 50 == 0:
            pose_covariance = np.array(message.pose.covariance).reshape(6, 6)
            truth = flight(flyer.time_of(index))
            pose_nees.append(nees(truth, pose_of(message.pose.pose), pose_covariance))
            covariance = np.array(message.twist.covariance).reshape(6, 6)
            twist_nees.append(float(error @ np.linalg.solve(covariance, error)))
    # Of 450 frames 0.45 are expected; five or more come once in five thousand runs.
    assert refused < 5
    # Every frame once.
    assert len({key(m.header.stamp) for m in flyer.odometry}) == len(flyer.odometry)
    assert len(flyer.odometry) == frames - CONFIRM_FRAMES + 1
    rmse = np.sqrt(np.mean(np.square(twist_errors), axis=0))
    print(f"twist RMSE {rmse[:3]} m/s, {np.degrees(rmse[3:])} deg/s")
    print(f"NEES of 6: pose {np.mean(pose_nees):.2f}, twist {np.mean(twist_nees):.2f}")
    assert rmse[:3].max() < 0.1
    assert np.degrees(rmse[3:]).max() < 2.0
    # The noise is chosen larger than this motion needs, so only too large a NEES is dishonest.
    _, high = mean_nees_bounds(len(pose_nees))
    assert np.mean(pose_nees) < high
    assert np.mean(twist_nees) < high


def test_late_frames_are_used_at_their_own_time_and_repeated_ones_not_at_all(flyer: Flyer) -> None:
    last = flyer.confirm()
    left_out = flyer.next_index()
    newest = flyer.frame(flyer.next_index())
    assert flyer.ask(newest)[1] == "UPDATED"
    before = len(flyer.odometry)

    answer, track, _ = flyer.ask(flyer.frame(left_out))
    assert (answer.outcome, track) == ("OK", "INSERTED")
    assert answer.pose is not None
    for repeated in (newest, flyer.frame(last), flyer.frame(left_out)):
        stamp = key(repeated.header.stamp)
        flyer.estimator.send(repeated)
        statuses = flyer.estimator.statuses[stamp]
        flyer.estimator.peer.spin_until(lambda: len(statuses) == 2, "the second status")
        assert statuses[-1].outcome == EstimatorStatus.OK
        assert TRACKS[statuses[-1].track] == "OUT_OF_ORDER"

    assert flyer.ask(flyer.frame(flyer.next_index()))[1] == "UPDATED"
    assert len(flyer.odometry) == before + 1, "odometry that goes back in time"


def test_a_frame_that_is_late_by_more_than_half_a_second_is_not_used(flyer: Flyer) -> None:
    flyer.confirm()
    left_out = flyer.next_index()
    for _ in range(round(0.6 / PERIOD_S)):
        flyer.ask(flyer.frame(flyer.next_index()))
    answer, track, _ = flyer.ask(flyer.frame(left_out))
    assert (answer.outcome, track) == ("OK", "OUT_OF_ORDER")


def test_without_poses_the_track_is_predicted_with_growing_covariance_then_dropped_and_found_again(
    flyer: Flyer,
) -> None:
    last = flyer.confirm()
    grown = []
    while flyer.time_of(index := flyer.next_index()) - flyer.time_of(last) <= 1.0:
        answer, track, message = flyer.ask(flyer.spoilt(index))
        assert (answer.outcome, track) == ("UNKNOWN_ID", "PREDICTED")
        assert message is not None
        grown.append(sigmas(message))
    assert len(grown) == BEYOND_GAP - 2
    assert np.all(np.diff(grown, axis=0) > 0.0)
    _, track, _ = flyer.ask(flyer.spoilt(index))
    assert track == "NONE"

    tracks = [flyer.ask(flyer.frame(flyer.next_index()))[1] for _ in range(CONFIRM_FRAMES)]
    assert tracks == ["CANDIDATE"] * (CONFIRM_FRAMES - 1) + ["UPDATED"]
    # Silence is a gap too.
    _, track, _ = flyer.ask(flyer.frame(flyer.next_index(skip=BEYOND_GAP)))
    assert track == "CANDIDATE"


def test_reset_forgets_the_track(flyer: Flyer, peer: Peer) -> None:
    flyer.confirm()

    response = peer.call(Trigger, "/tanker_pose/reset", Trigger.Request())

    assert response.success, response.message
    tracks = [flyer.ask(flyer.frame(flyer.next_index()))[1] for _ in range(CONFIRM_FRAMES)]
    assert tracks == ["CANDIDATE"] * (CONFIRM_FRAMES - 1) + ["UPDATED"]


def test_left_and_right_exchanged_or_a_believable_wrong_pose_does_not_move_the_track(
    flyer: Flyer,
) -> None:
    flyer.confirm()
    for _ in range(20):
        flyer.ask(flyer.frame(flyer.next_index()))
    index = flyer.next_index()
    exchanged = flyer.frame(index)
    for point in exchanged.points:
        point.id = {1: 2, 2: 1, 3: 4, 4: 3}.get(point.id, point.id)
    aside_index = flyer.next_index()
    truth = flight(flyer.time_of(aside_index))
    aside = messages.exact_frame(
        aside_index, Pose(truth.rotation, truth.translation + np.array([2.0, 0.0, 0.0]))
    )

    answer, track, message = flyer.ask(exchanged)
    assert answer.outcome != "OK"
    assert track == "PREDICTED"
    found = [(flight(flyer.time_of(index)), message)]
    answer, track, message = flyer.ask(aside)
    assert (answer.outcome, track) == ("OK", "GATED"), "a single frame cannot tell"
    found.append((truth, message))
    for truth, message in found:
        assert message is not None
        error = truth.translation - pose_of(message.pose.pose).translation
        assert np.all(np.abs(error) < 3.0 * sigmas(message)[:3])
    assert flyer.ask(flyer.frame(flyer.next_index()))[1] == "UPDATED"


def test_parameters_of_the_track_hold_from_the_next_frame_on(flyer: Flyer, peer: Peer) -> None:
    client = Client(peer)
    flyer.confirm()

    assert client.set(track=False)[0].successful
    _, track, _ = flyer.ask(flyer.frame(flyer.next_index()))
    assert track == "NONE"
    assert client.set(track=True)[0].successful
    assert client.set(confirm_frames=2)[0].successful
    tracks = [flyer.ask(flyer.frame(flyer.next_index()))[1] for _ in range(2)]
    assert tracks == ["CANDIDATE", "UPDATED"]
    assert client.set(max_gap_s=0.1)[0].successful
    _, track, _ = flyer.ask(flyer.frame(flyer.next_index(skip=6)))
    assert track == "CANDIDATE"


def test_a_replayed_bag_gives_the_odometry_of_the_live_flight_bit_for_bit(
    flyer: Flyer, peer: Peer, tmp_path: Path
) -> None:
    frames = 100
    truths = write_approach_bag(
        tmp_path / "approach", StoragePlugin.MCAP, frames, np.random.default_rng(7)
    )
    player = play(tmp_path / "approach", peer.domain)
    peer.spin_until(lambda: player.poll() is not None, "the player to end", timeout_s=30.0)
    printed, _ = player.communicate()
    assert player.returncode == 0, printed
    expected = frames - CONFIRM_FRAMES + 1
    peer.spin_until(lambda: len(flyer.odometry) >= expected, "odometry of the replayed frames")
    replayed = list(flyer.odometry)
    flyer.odometry.clear()
    peer.call(Trigger, "/tanker_pose/reset", Trigger.Request())

    # The same numbers, at whatever pace the answers allow.
    rng = np.random.default_rng(7)
    for index, pose in enumerate(approach(frames)):
        flyer.estimator.send(messages.noisy_frame(index, pose, rng))
        peer.spin_for(0.005)
    peer.spin_until(lambda: len(flyer.odometry) >= expected, "odometry of the live frames")

    assert {key(message.header.stamp) for message in replayed} <= truths.keys()
    assert replayed == flyer.odometry
