"""Where the node is found: names, types, remaps, namespaces, for every ROS 2 tool to see."""

import pytest

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.domains import claimed_domain
from harness.estimator import Topics
from harness.peer import Peer

SUBSCRIBED = {
    "/feature_points": "tanker_pose/msg/FeaturePointArray",
    "/camera_info": "sensor_msgs/msg/CameraInfo",
}
PUBLISHED = {
    "/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/status": "tanker_pose/msg/EstimatorStatus",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


def test_node_and_topics_appear_with_their_types(start_node: StartNode, peer: Peer) -> None:
    start_node()

    peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node's name in the graph")
    peer.spin_until(
        lambda: (
            SUBSCRIBED.keys()
            <= {
                name
                for name, _ in peer.node.get_subscriber_names_and_types_by_node("tanker_pose", "/")
            }
        ),
        "the node's subscriptions in the graph",
    )
    peer.spin_until(
        lambda: (
            PUBLISHED.keys()
            <= {
                name
                for name, _ in peer.node.get_publisher_names_and_types_by_node("tanker_pose", "/")
            }
        ),
        "the node's publishers in the graph",
    )

    found = dict(peer.node.get_topic_names_and_types())
    assert {topic: found[topic] for topic in SUBSCRIBED | PUBLISHED} == {
        topic: [kind] for topic, kind in (SUBSCRIBED | PUBLISHED).items()
    }


def test_remapped_topics(start_estimator: StartEstimator, peer: Peer) -> None:
    estimator = start_estimator(
        "-r",
        "feature_points:=/detector/points",
        "-r",
        "camera_info:=/sensor/info",
        "-r",
        "pose:=/navigation/tanker",
        "-r",
        "status:=/navigation/tanker_status",
        topics=Topics(
            "/detector/points", "/sensor/info", "/navigation/tanker", "/navigation/tanker_status"
        ),
    )
    estimator.use_camera()

    estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    assert peer.node.count_subscribers("/feature_points") == 0


def test_a_namespace_moves_relative_topics_and_leaves_absolute_ones(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    estimator = start_estimator("-r", "__ns:=/uav1", topics=Topics().under("/uav1"))
    estimator.use_camera()

    estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    assert peer.sees_node("/uav1/tanker_pose")
    assert peer.node.count_publishers("/diagnostics") == 1
    assert peer.node.count_publishers("/uav1/diagnostics") == 0


def test_another_node_name(start_node: StartNode, peer: Peer) -> None:
    start_node("-r", "__node:=port_side")

    peer.spin_until(lambda: peer.sees_node("/port_side"), "the node under its other name")
    assert not peer.sees_node("/tanker_pose")


@pytest.mark.parametrize(
    "argument, said",
    [
        ("feature_points:=", "expected a value after :="),
        ("feature_points:=/two//slashes", "/two//slashes"),
        ("__ns:=not/absolute", "not/absolute"),
        ("no_arrow", "no_arrow"),
    ],
)
def test_a_remap_that_cannot_be_is_refused(start_node: StartNode, argument: str, said: str) -> None:
    node = start_node("-r", argument)

    assert node.wait() != 0
    assert said in node.log
    assert "panicked" not in node.log


@pytest.mark.parametrize("domain_id", ["233", "-1", "tanker"])
def test_a_domain_that_cannot_be_is_refused(start_node: StartNode, domain_id: str) -> None:
    node = start_node(environment={"ROS_DOMAIN_ID": domain_id})

    assert node.wait() != 0
    assert "ROS_DOMAIN_ID" in node.log
    assert domain_id in node.log


def test_a_node_in_another_domain_is_not_seen(start_node: StartNode, peer: Peer) -> None:
    with claimed_domain() as other:
        start_node("-r", "__node:=elsewhere", environment={"ROS_DOMAIN_ID": str(other)})
        start_node()

        peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node of our own domain")

        assert not peer.sees_node("/elsewhere")


def test_the_nodes_publishers_are_reliable(start_estimator: StartEstimator, peer: Peer) -> None:
    # expect_pose already receives with reliable subscriptions; the graph must say so too.
    start_estimator()

    for topic in ("/pose", "/status"):
        (endpoint,) = peer.node.get_publishers_info_by_topic(topic)
        assert endpoint.qos_profile.reliability.name == "RELIABLE"
        assert endpoint.node_name == "tanker_pose"
