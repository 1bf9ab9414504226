"""Words of a megabyte from others: none of them leaves the node again, in whatever message or log line."""

from collections.abc import Iterator
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log, Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo
from tanker_pose.msg import EstimatorStatus, FeaturePointArray
from visualization_msgs.msg import MarkerArray

from harness import messages
from harness.conftest import StartEstimator
from harness.estimator import Estimator
from harness.peer import RELIABLE, Peer

LONG = "x" * 1_000_000
# With a line that looks like one of the log's own.
FORGED = "camera\n[ERROR] [1.0] [autopilot]: all is lost"
# Bytes: a description of a fault with a few cut words in it.
LONGEST = 4200
# What a name may have, bytes.
LONGEST_NAME = 255

TOPICS: dict[str, tuple[type, QoSProfile]] = {
    "/status": (EstimatorStatus, RELIABLE),
    "/pose": (PoseWithCovarianceStamped, RELIABLE),
    "/odometry": (Odometry, RELIABLE),
    "/markers": (MarkerArray, RELIABLE),
    "/diagnostics": (DiagnosticArray, RELIABLE),
    "/rosout": (Log, RELIABLE),
}


def strings(message: Any) -> Iterator[str]:
    """All text in a message."""
    if isinstance(message, str):
        yield message
    elif isinstance(message, list | tuple):
        for member in message:
            yield from strings(member)
    elif hasattr(message, "get_fields_and_field_types"):
        for field in message.get_fields_and_field_types():
            yield from strings(getattr(message, field))


def long_frame(index: int) -> FeaturePointArray:
    frame = messages.exact_frame(index)
    frame.header.frame_id = LONG
    return frame


@pytest.fixture
def heard(peer: Peer) -> dict[str, list[Any]]:
    return {topic: peer.collect(kind, topic, qos) for topic, (kind, qos) in TOPICS.items()}


def ask(peer: Peer, kind: type, name: str, request: Any) -> Any:
    client = peer.node.create_client(kind, f"/tanker_pose/{name}")
    peer.spin_until(client.service_is_ready, f"the service {name}")
    answer = client.call_async(request)
    peer.spin_until(answer.done, f"an answer of {name}")
    return answer.result()


def long_parameters(peer: Peer) -> list[Any]:
    """The answers to requests with long names and values."""
    text = ParameterValue(type=4, string_value=LONG)
    return [
        ask(peer, SetParameters, "set_parameters", SetParameters.Request(parameters=[parameter]))
        for parameter in (
            Parameter(name=LONG, value=text),
            Parameter(name="qos_overrides./pose.publisher." + LONG, value=text),
            Parameter(name="initialisation", value=text),
            Parameter(name="min_points", value=text),
            Parameter(name="tanker_frame_id", value=text),
            Parameter(name="max_outliers" + LONG),
        )
    ] + [
        ask(
            peer,
            DescribeParameters,
            "describe_parameters",
            DescribeParameters.Request(names=[LONG]),
        )
    ]


def long_camera_infos() -> list[CameraInfo]:
    of_model, of_frame, of_both = (messages.camera_info() for _ in range(3))
    of_model.distortion_model = LONG
    of_frame.header.frame_id = LONG
    of_both.distortion_model = of_both.header.frame_id = LONG
    return [of_model, of_both, of_frame]


def test_no_word_of_a_megabyte_is_echoed(
    peer: Peer, start_estimator: StartEstimator, heard: dict[str, list[Any]]
) -> None:
    estimator = start_estimator("-p", "publish_markers:=true", qos=RELIABLE)
    estimator.use_camera()

    refusals = [ask_of_long_frame(estimator)]
    answers = long_parameters(peer)
    for info in long_camera_infos():
        count = len(heard["/diagnostics"])
        estimator.info_publisher.publish(info)
        refusals.append(ask_of_long_frame(estimator))
        peer.spin_until(lambda n=count: len(heard["/diagnostics"]) > n + 1, "two reports")

    # The same name on both sides is none to be passed on: no pose carries it.
    assert heard["/pose"] == [] and heard["/odometry"] == []
    outcomes = {refusal.outcome for refusal in refusals}
    assert outcomes == {"FRAME_MISMATCH", "INVALID_CAMERA_INFO"} or outcomes == {"FRAME_MISMATCH"}
    for refusal in refusals:
        assert refusal.status.header.frame_id == "x" * 60 + "… (1000000 bytes)"
    assert "frame_id of 255 bytes at most" in refusals[0].status.message

    said = answers + [message for topic in heard for message in heard[topic]]
    assert len(heard["/rosout"]) > 3 and len(heard["/diagnostics"]) > 3 and heard["/markers"]
    longest = max((len(text.encode()), text[:100]) for message in said for text in strings(message))
    assert longest[0] <= LONGEST, longest
    assert max(len(line) for line in estimator.process.log.splitlines()) <= LONGEST
    for topic in ("/status", "/markers"):
        names = [text for message in heard[topic] for text in strings(message)]
        assert max(len(name.encode()) for name in names) <= LONGEST

    estimator.use_camera()
    estimator.ask_until(
        messages.exact_frame, lambda answer: answer.outcome == "OK", "poses as before"
    )


def ask_of_long_frame(estimator: Estimator) -> Any:
    return estimator.ask(long_frame(estimator.next_index()))


@pytest.mark.parametrize("length, outcome", [(LONGEST_NAME, "OK"), (LONGEST_NAME + 1, "FRAME_MISMATCH")])
def test_a_name_is_passed_bit_for_bit_up_to_its_limit_and_refused_beyond(
    start_estimator: StartEstimator, length: int, outcome: str
) -> None:
    estimator = start_estimator()
    name = "ä" + "y" * (length - 2)
    estimator.use_camera(messages.camera_info(frame_id=name))
    frame = messages.exact_frame(estimator.next_index())
    frame.header.frame_id = name

    answer = estimator.ask(frame)

    assert answer.outcome == outcome, answer.status.message
    if outcome == "OK":
        assert answer.pose is not None and answer.pose.header == frame.header
        assert answer.status.header == frame.header


def test_a_word_makes_no_line_of_the_log(start_estimator: StartEstimator) -> None:
    estimator = start_estimator()
    estimator.use_camera(messages.camera_info(frame_id=FORGED))
    frame = messages.exact_frame(estimator.next_index())

    answer = estimator.expect_refusal(frame, "FRAME_MISMATCH", good_frame=None)

    assert "camera\\n[ERROR]" in answer.status.message
    lines = estimator.process.log.splitlines()
    assert [line for line in lines if "all is lost" in line and "camera\\n[ERROR]" in line]
    assert not [line for line in lines if line.startswith("[ERROR]")]
