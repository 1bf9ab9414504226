"""Quality of service by parameters under ROS's own names, as the graph shows it."""

from pathlib import Path

import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.peer import Peer
from harness.test_parameter_services import Client
from harness.waiting import wait_until

TYPES = {
    "/feature_points": "tanker_pose/msg/FeaturePointArray",
    "/camera_info": "sensor_msgs/msg/CameraInfo",
    "/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/status": "tanker_pose/msg/EstimatorStatus",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
INPUTS = {"/feature_points", "/camera_info"}


def endpoint(peer: Peer, topic: str, node: str = "tanker_pose") -> TopicEndpointInfo:
    """The node's one end of the topic, as the graph shows it."""
    query = (
        peer.node.get_subscriptions_info_by_topic
        if topic in INPUTS
        else peer.node.get_publishers_info_by_topic
    )

    def found() -> list[TopicEndpointInfo]:
        return [info for info in query(topic) if info.node_name == node]

    wait_until(lambda: len(found()) == 1, f"{topic} of {node} in the graph")
    return found()[0]


def override(topic: str, policy: str, value: object) -> tuple[str, str]:
    role = "subscription" if topic in INPUTS else "publisher"
    return "-p", f"qos_overrides.{topic}.{role}.{policy}:={value}"


def test_the_graph_shows_node_topics_types_and_qos(start_node: StartNode, peer: Peer) -> None:
    start_node("-p", "publish_tf:=true")
    peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node in the graph")

    for topic, type_name in TYPES.items():
        info = endpoint(peer, topic)
        reliable = topic not in INPUTS
        assert info.topic_type == type_name
        assert (info.qos_profile.reliability == ReliabilityPolicy.RELIABLE) == reliable, topic
        assert info.qos_profile.durability == DurabilityPolicy.VOLATILE, topic


@pytest.mark.parametrize("topic", TYPES)
def test_an_override_is_seen_in_the_graph(start_node: StartNode, peer: Peer, topic: str) -> None:
    reliable = topic in INPUTS  # the other way round than by default
    start_node(
        "-p",
        "publish_tf:=true",
        *override(topic, "reliability", "reliable" if reliable else "best_effort"),
        *override(topic, "durability", "transient_local"),
        *override(topic, "deadline", 250_000_000),
        *override(topic, "depth", 3),
    )

    qos = endpoint(peer, topic).qos_profile

    assert (qos.reliability == ReliabilityPolicy.RELIABLE) == reliable
    assert qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    # The wire counts in parts of 2^-32 s.
    assert abs(qos.deadline.nanoseconds - Duration(seconds=0.25).nanoseconds) <= 1
    for other in TYPES.keys() - {topic}:
        assert endpoint(peer, other).qos_profile.durability == DurabilityPolicy.VOLATILE, other


def test_overrides_come_from_files_too_and_follow_remaps(
    start_node: StartNode, peer: Peer, tmp_path: Path
) -> None:
    file = tmp_path / "qos.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    qos_overrides:\n      /tanker/pose:\n"
        "        publisher: {reliability: best_effort}\n",
        encoding="utf-8",
    )
    start_node("--params-file", str(file), "-r", "pose:=/tanker/pose")

    assert endpoint(peer, "/tanker/pose").qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


@pytest.mark.parametrize(
    "name, value, expected, got",
    [
        ("/pose.publisher.reliability", "sometimes", "one of reliable, best_effort", "sometimes"),
        ("/pose.publisher.durability", "1", "one of volatile, transient_local", "1 (integer)"),
        ("/camera_info.subscription.history", "keep", "one of keep_last, keep_all", "keep"),
        ("/diagnostics.publisher.depth", "0", "an integer from 1 to 10000", "0 (integer)"),
        ("/tf.publisher.deadline", "-5", "an integer from 0", "-5 (integer)"),
        ("/status.publisher.lifespan", "1", "reliability, durability, history", "lifespan"),
        ("/status.subscription.depth", "1", "/status.publisher.", "subscription"),
    ],
)
def test_a_bad_override_stops_the_node_with_expected_and_got(
    start_node: StartNode, name: str, value: str, expected: str, got: str
) -> None:
    node = start_node("-p", f"qos_overrides.{name}:={value}")

    assert node.wait() != 0
    assert name in node.log
    assert expected in node.log and got in node.log
    assert "panicked" not in node.log


def test_only_topics_that_are_open_are_listed_and_overrides_of_others_are_warned_of(
    start_node: StartNode, peer: Peer
) -> None:
    node = start_node(
        *override("/tf", "depth", 1),
        *override("/status", "reliability", "system_default"),
    )
    names = Client(peer).names(["qos_overrides"])

    topics = {name.removeprefix("qos_overrides.").split(".")[0] for name in names}
    assert topics == {
        "/feature_points", "/camera_info", "/pose", "/odometry", "/status", "/diagnostics"
    }
    assert "qos_overrides./tf.publisher.depth\" has no effect" in node.log
    assert endpoint(peer, "/status").qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_an_override_of_a_foreign_topic_is_warned_of(
    start_estimator: StartEstimator,
) -> None:
    estimator = start_estimator("-p", "qos_overrides./image.publisher.depth:=1")
    estimator.use_camera()

    assert "/image.publisher.depth" in estimator.process.log
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
