"""Coming and going: any order of start, restarts, and a clean leave that the whole graph sees."""

import signal
import time

import pytest
from sensor_msgs.msg import CameraInfo
from tanker_pose.msg import FeaturePointArray

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.estimator import Estimator, Topics
from harness.peer import BEST_EFFORT, RELIABLE, Peer

GONE_WITHIN_S = 1.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_after_a_signal_name_and_endpoints_are_gone_within_a_second(
    estimator: Estimator, number: int
) -> None:
    peer, node = estimator.peer, estimator.process
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    published = [name for name, _ in publishers(peer)]
    assert {"/pose", "/status", "/diagnostics", "/rosout"} <= set(published)

    node.send(number)
    start = time.monotonic()

    def gone() -> bool:
        return (
            not peer.sees_node("/tanker_pose")
            and not any(
                info.node_name == "tanker_pose"
                for topic in published
                for info in peer.node.get_publishers_info_by_topic(topic)
            )
            and peer.node.count_publishers("/pose") == 0
            and peer.node.count_subscribers("/feature_points") == 0
            and peer.node.count_subscribers("/camera_info") == 0
            and estimator.points_publisher.get_subscription_count() == 0
        )

    peer.spin_until(gone, "the node's name and endpoints to leave the graph", GONE_WITHIN_S)
    assert node.wait(timeout_s=GONE_WITHIN_S) == 0, node.log
    assert time.monotonic() - start < 2 * GONE_WITHIN_S


def publishers(peer: Peer) -> list[tuple[str, list[str]]]:
    return peer.node.get_publisher_names_and_types_by_node("tanker_pose", "/")


def test_a_node_without_any_input_stops_cleanly(start_node: StartNode, peer: Peer) -> None:
    node = start_node()
    peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node's name in the graph")

    node.stop()

    assert "panicked" not in node.log


def test_a_publisher_that_was_there_first_is_heard(start_node: StartNode, peer: Peer) -> None:
    publish_for_a_while(peer)

    estimator = Estimator(peer, start_node())
    estimator.wait_until_heard()
    estimator.use_camera()
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))


def publish_for_a_while(peer: Peer) -> None:
    """Publishers that already talk to nobody before the node starts."""
    info = peer.node.create_publisher(CameraInfo, "/camera_info", BEST_EFFORT)
    points = peer.node.create_publisher(FeaturePointArray, "/feature_points", BEST_EFFORT)
    for index in range(10):
        info.publish(messages.camera_info())
        points.publish(messages.exact_frame(index))
        peer.spin_for(0.02)


def test_a_restarted_publisher_is_heard_again(start_estimator: StartEstimator, domain: int) -> None:
    estimator = start_estimator()
    estimator.use_camera()
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    estimator.peer.node.destroy_publisher(estimator.points_publisher)

    second = Peer(domain, name="restarted")
    try:
        again = Estimator(second, estimator.process)
        again.wait_until_heard()
        # The camera info of the first publisher still stands.
        again.expect_pose(messages.exact_frame(1_000))
    finally:
        second.close()


def test_a_restarted_node_is_heard_again(
    start_estimator: StartEstimator, start_node: StartNode, peer: Peer
) -> None:
    first = start_estimator()
    first.use_camera()
    first.expect_pose(messages.exact_frame(1))
    first.process.stop()

    second = Estimator(peer, start_node())
    second.wait_until_heard()
    second.use_camera()

    second.expect_pose(messages.exact_frame(1_000))


@pytest.mark.parametrize("qos", [RELIABLE, BEST_EFFORT], ids=["reliable", "best effort"])
def test_publishers_of_either_reliability_are_heard(start_estimator: StartEstimator, qos) -> None:
    estimator = start_estimator(qos=qos)
    estimator.use_camera()

    for _ in range(20):
        estimator.expect_pose(messages.exact_frame(estimator.next_index()))


def test_two_nodes_side_by_side_answer_each_their_own(start_node: StartNode, peer: Peer) -> None:
    estimators = [
        Estimator(peer, start_node("-r", f"__ns:={side}"), Topics().under(side))
        for side in ("/port", "/starboard")
    ]

    for index, estimator in enumerate(estimators):
        estimator.wait_until_heard()
        estimator.use_camera()
        estimator.expect_pose(messages.exact_frame(index))
        assert set(estimator.poses) == {messages.key(messages.stamp_of(index))}
