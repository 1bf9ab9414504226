"""`tanker_pose replay`: bags that rosbags has written, answered without ROS, and read back by rosbags."""

import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from tanker_pose.msg import EstimatorStatus

from harness.bags import Recorder, read_bag, write_approach_bag
from harness.conftest import StartNode
from harness.consistency import mean_nees_bounds, nees
from harness.messages import key, pose_of
from harness.peer import Peer
from harness.processes import REPOSITORY, binary, child_environment
from harness.test_bags import play
from harness.typestore import typestore

FRAMES = 150
# The paper's markers come within 3 px of the edge, and these detections are of points, which nothing can cut.
POINTS = ("-p", "edge_margin_px:=0.0")
# On a loaded machine frames may wait: the node is to skip none.
PATIENT = ("-p", "qos_overrides./feature_points.subscription.depth:=100")
# Everything that needs no attitude of the receiver.
ALL_OUTPUTS = (
    *("-p", "publish_tf:=true", "-p", "publish_integrity:=true", "-p", "publish_markers:=true"),
    *("-p", "publish_predicted_points:=true", "-p", "publish_receptacle:=true"),
    *("-p", "publish_mavros_landing_target:=true"),
    *("-p", f"refuelling:={REPOSITORY / 'config' / 'refuelling' / 'example.yaml'}"),
)
STORAGES = pytest.mark.parametrize(
    "storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=["mcap", "sqlite3"]
)


def replay(bag: Path, output: Path, *ros_arguments: str) -> str:
    """Replays a whole bag; what the tool prints."""
    command = [str(binary("tanker_pose")), "replay", str(bag), "-o", str(output), "--ros-args"]
    done = subprocess.run(
        [*command, *ros_arguments],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def raw_messages(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Times and bytes of all messages of a bag, by topic."""
    found: dict[str, list[tuple[int, bytes]]] = {}
    with AnyReader([bag], default_typestore=typestore()) as reader:
        for connection, time_ns, raw in reader.messages():
            found.setdefault(connection.topic, []).append((time_ns, bytes(raw)))
    return found


@STORAGES
def test_every_frame_of_a_bag_is_answered_with_an_honest_pose_beside_its_inputs(
    tmp_path: Path, rng: np.random.Generator, storage: StoragePlugin
) -> None:
    truths = write_approach_bag(tmp_path / "approach", storage, FRAMES, rng)

    printed = replay(tmp_path / "approach", tmp_path / "out.mcap", *POINTS)

    assert f"{FRAMES} frames" in printed
    found = read_bag(tmp_path / "out.mcap")
    assert [status.outcome for status in found["/status"]] == [EstimatorStatus.OK] * FRAMES
    poses = {key(pose.header.stamp): pose for pose in found["/pose"]}
    assert poses.keys() == truths.keys()
    values = [
        nees(truth, pose_of(poses[stamp].pose.pose), poses[stamp].pose.covariance.reshape(6, 6))
        for stamp, truth in truths.items()
    ]
    low, high = mean_nees_bounds(FRAMES)
    assert low < np.mean(values) < high
    inputs, answers = raw_messages(tmp_path / "approach"), raw_messages(tmp_path / "out.mcap")
    for topic, messages in inputs.items():
        assert answers[topic] == messages, topic


def test_rosbags_reads_every_answer_field_by_field_by_the_definitions_in_the_file(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    write_approach_bag(tmp_path / "approach", StoragePlugin.MCAP, FRAMES, rng)
    replay(tmp_path / "approach", tmp_path / "out.mcap", *POINTS, *ALL_OUTPUTS)

    inputs = raw_messages(tmp_path / "approach")
    own = typestore()
    seen: set[str] = set()
    with AnyReader([tmp_path / "out.mcap"]) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic in inputs:
                continue
            kind = connection.msgtype
            message = reader.deserialize(raw, kind)
            # Written again, it has the same bytes: no field is missing, and none is read as another.
            assert bytes(reader.typestore.serialize_cdr(message, kind)) == bytes(raw), kind
            if kind in own.fielddefs:
                assert reader.typestore.fielddefs[kind][1] == own.fielddefs[kind][1], kind
                assert bytes(own.serialize_cdr(own.deserialize_cdr(raw, kind), kind)) == bytes(raw)
            seen.add(connection.topic)
    assert seen >= {
        *("/pose", "/status", "/odometry", "/integrity", "/tf", "/markers", "/predicted_points"),
        *("/receptacle", "/mavros/landing_target/raw", "/diagnostics"),
    }


def without_solve_time(status: Any) -> Any:
    """The status without what only a clock can tell."""
    status.solve_time.sec = status.solve_time.nanosec = 0
    return status


def as_plain(message: Any) -> Any:
    """Fields of a message of rosbags, comparable; NaN equals itself."""
    if isinstance(message, np.ndarray):
        return message.tobytes()
    if hasattr(message, "__dataclass_fields__"):
        return {name: as_plain(getattr(message, name)) for name in message.__dataclass_fields__}
    if isinstance(message, list):
        return [as_plain(item) for item in message]
    return repr(message) if isinstance(message, float) else message


@STORAGES
def test_live_node_gives_the_same_answers_frame_by_frame(
    start_node: StartNode,
    peer: Peer,
    tmp_path: Path,
    rng: np.random.Generator,
    storage: StoragePlugin,
) -> None:
    bag = tmp_path / "approach"
    write_approach_bag(bag, storage, FRAMES, rng)
    topics = {"/pose": PoseWithCovarianceStamped, "/status": EstimatorStatus, "/odometry": Odometry}
    recorder = Recorder(peer, tmp_path / "live", topics, StoragePlugin.MCAP)
    with closing(recorder):
        start_node(*POINTS, *PATIENT)
        peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node in the graph")
        # The bag begins with half a second of camera infos, in which the endpoints find each other.
        player = play(bag, peer.domain)
        peer.spin_until(lambda: player.poll() is not None, "the player to end", timeout_s=30.0)
        printed, _ = player.communicate()
        assert player.returncode == 0, printed
        peer.spin_until(lambda: recorder.count("/status") >= FRAMES, "a status for every frame")
        peer.spin_until(lambda: recorder.count("/pose") >= FRAMES, "a pose for every frame")
        peer.spin_for(0.5)
    live = read_bag(tmp_path / "live")

    replay(bag, tmp_path / "out.mcap", *POINTS, *PATIENT)

    offline = read_bag(tmp_path / "out.mcap")
    for topic in topics:
        expected, found = live[topic], offline[topic]
        if topic == "/status":
            expected = [without_solve_time(status) for status in expected]
        assert len(found) == len(expected), topic
        for one, other in zip(found, expected, strict=True):
            assert as_plain(one) == as_plain(other), topic


def test_two_replays_are_byte_identical(tmp_path: Path, rng: np.random.Generator) -> None:
    write_approach_bag(tmp_path / "approach", StoragePlugin.SQLITE3, FRAMES, rng)

    for name in ("first.mcap", "second.mcap"):
        replay(tmp_path / "approach", tmp_path / name, *ALL_OUTPUTS)

    first, second = (tmp_path / name for name in ("first.mcap", "second.mcap"))
    assert first.read_bytes() == second.read_bytes()
