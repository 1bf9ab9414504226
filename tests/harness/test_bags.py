"""The road by bag: a recorded approach played into the node, its answers recorded and read back."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rosbags.rosbag2 import StoragePlugin
from tanker_pose.msg import EstimatorStatus

from harness.bags import Recorder, read_bag, write_approach_bag
from harness.conftest import StartEstimator
from harness.consistency import mean_nees_bounds, nees
from harness.messages import CAMERA_FRAME, key, pose_of
from harness.peer import Peer
from harness.processes import REPOSITORY, child_environment
from harness.rotations import Pose

FRAMES = 150
BAG_EXAMPLES = REPOSITORY / "examples" / "bags"
# On a loaded machine frames may wait: the node is to skip none. What it does when many wait is test_backlog's subject.
PATIENT = ("-p", "qos_overrides./feature_points.subscription.depth:=100")
TOPICS = {"/pose": PoseWithCovarianceStamped, "/status": EstimatorStatus}


@pytest.mark.parametrize(
    "storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=["mcap", "sqlite3"]
)
def test_every_frame_of_a_played_approach_is_answered_with_an_honest_pose(
    start_estimator: StartEstimator,
    peer: Peer,
    tmp_path: Path,
    rng: np.random.Generator,
    storage: StoragePlugin,
) -> None:
    truths = write_approach_bag(tmp_path / "approach", storage, FRAMES, rng)
    recorder = Recorder(peer, tmp_path / "answers", TOPICS, storage)
    # The paper's markers come within 3 px of the edge, and these detections are of points, which nothing can cut.
    with closing(recorder):
        start_estimator("-p", "edge_margin_px:=0.0", *PATIENT)
        probes = recorder.count("/status")

        player = play(tmp_path / "approach", peer.domain)
        peer.spin_until(lambda: player.poll() is not None, "the player to end", timeout_s=30.0)
        printed, _ = player.communicate()
        assert player.returncode == 0, printed
        peer.spin_until(
            lambda: recorder.count("/status") >= probes + FRAMES, "a status for every frame"
        )
        peer.spin_until(lambda: recorder.count("/pose") >= FRAMES, "a pose for every frame")

    recorded = read_bag(tmp_path / "answers")
    outcomes = {key(status.header.stamp): status.outcome for status in recorded["/status"]}
    assert {outcomes.get(stamp) for stamp in truths} == {EstimatorStatus.OK}
    poses = {key(pose.header.stamp): pose for pose in recorded["/pose"]}
    assert poses.keys() == truths.keys()
    assert {pose.header.frame_id for pose in poses.values()} == {CAMERA_FRAME}
    values = [
        nees(truth, pose_of(poses[stamp].pose.pose), poses[stamp].pose.covariance.reshape(6, 6))
        for stamp, truth in truths.items()
    ]
    low, high = mean_nees_bounds(FRAMES)
    assert low < np.mean(values) < high


def play(bag: Path, domain: int) -> subprocess.Popen[str]:
    """The player as its own process, as a person would start it."""
    return subprocess.Popen(
        [sys.executable, str(BAG_EXAMPLES / "play_bag.py"), str(bag)],
        env=child_environment(domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def test_the_truth_in_the_bag_is_the_truth(tmp_path: Path, rng: np.random.Generator) -> None:
    truths = write_approach_bag(tmp_path / "approach", StoragePlugin.MCAP, 20, rng)

    read = read_bag(tmp_path / "approach")

    assert len(read["/feature_points"]) == len(read["/truth"]) == 20
    for message in read["/truth"]:
        found: Pose = pose_of(message.pose)
        truth = truths[key(message.header.stamp)]
        assert np.allclose(found.rotation, truth.rotation, atol=1e-12)
        assert np.array_equal(found.translation, truth.translation)
