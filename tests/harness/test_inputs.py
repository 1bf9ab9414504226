"""Detectors of others plug in: vision_msgs and apriltag_msgs give poses, and every slip its reason."""

import math
from pathlib import Path

import numpy as np
import pytest
from apriltag_msgs.msg import AprilTagDetectionArray
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from scipy.stats import chi2
from vision_msgs.msg import Detection2DArray

from harness import detectors, messages, paper
from harness.conftest import StartEstimator, StartNode
from harness.consistency import pose_error
from harness.detectors import APRILTAGS, POINT_IDS, SINGLE, VISION, box
from harness.estimator import Estimator
from harness.messages import covariance_of, pose_of
from harness.peer import Peer

# m and rad; the refinement stops at a thousandth of a sigma of 0.5 px.
EXACT = 3e-4


@pytest.fixture
def vision(start_estimator: StartEstimator) -> Estimator:
    """A node that listens to vision_msgs, with the paper's camera."""
    estimator = start_estimator("-p", "input:=detections", detector=VISION)
    estimator.use_camera()
    return estimator


@pytest.fixture
def apriltags(start_estimator: StartEstimator, tmp_path: Path) -> Estimator:
    """A node that listens to apriltag_msgs, with tags on its tanker and the paper's camera."""
    marker_map = detectors.write_tag_map(tmp_path / "tagged.yaml")
    estimator = start_estimator(
        "-p", "input:=apriltags", "-p", f"marker_map:={marker_map}", detector=APRILTAGS
    )
    estimator.use_camera()
    return estimator


# ---- vision_msgs ---------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [detectors.boxes, detectors.classified_boxes])
def test_boxes_named_by_id_or_by_their_best_class_give_the_pose(vision: Estimator, make) -> None:
    frame = make(vision.next_index())

    answer = vision.expect_pose(frame)

    assert np.abs(pose_error(paper.POSE, pose_of(answer.pose.pose.pose))).max() < EXACT
    assert answer.pose.header == answer.status.header == frame.header
    assert list(answer.status.used_ids) == list(paper.MARKERS)


def test_boxes_have_the_sigma_of_the_parameter(start_estimator: StartEstimator) -> None:
    estimator = start_estimator(
        "-p", "input:=detections", "-p", "pixel_sigma_px:=2.0", detector=VISION
    )
    estimator.use_camera()

    answer = estimator.expect_pose(detectors.boxes(estimator.next_index()))

    # The Cramér-Rao bound of the distance at this pose is 0.0583 m for each px.
    sigma_ahead = math.sqrt(covariance_of(answer.pose)[2, 2])
    assert sigma_ahead == pytest.approx(2.0 * 0.0583, rel=0.01)


def not_a_number(frame: Detection2DArray) -> None:
    frame.detections[0].id = "left_wing"


def no_name(frame: Detection2DArray) -> None:
    frame.detections[0].id = ""


def two_names(frame: Detection2DArray) -> None:
    frame.detections[0].results = [detectors.hypothesis("2", 1.0)]


def no_best_class(frame: Detection2DArray) -> None:
    frame.detections[0] = box(100, 100, classes={"1": 0.5, "2": 0.5})


def nan_score(frame: Detection2DArray) -> None:
    frame.detections[0] = box(100, 100, classes={"1": 0.5, "2": math.nan})


def unknown_id(frame: Detection2DArray) -> None:
    frame.detections[0].id = "4711"


def huge_id(frame: Detection2DArray) -> None:
    frame.detections[0].id = "9" * 1000


def duplicate_id(frame: Detection2DArray) -> None:
    frame.detections[0].id = frame.detections[1].id


def nan_pixel(frame: Detection2DArray) -> None:
    frame.detections[0].bbox.center.position.x = math.nan


def far_pixel(frame: Detection2DArray) -> None:
    frame.detections[0].bbox.center.position.y = -1e7


def no_boxes(frame: Detection2DArray) -> None:
    frame.detections = []


def zero_stamp(frame: Detection2DArray) -> None:
    frame.header.stamp = Time()


def nameless_and_unstamped(frame: Detection2DArray) -> None:
    no_name(frame)
    zero_stamp(frame)


def other_frame(frame: Detection2DArray) -> None:
    frame.header.frame_id = "another_camera"


def box_of_another_camera(frame: Detection2DArray) -> None:
    frame.detections[3].header.frame_id = "another_camera"


def box_of_another_time(frame: Detection2DArray) -> None:
    frame.detections[3].header.stamp = Time(sec=1)


@pytest.mark.parametrize(
    "spoil, outcome",
    [
        (not_a_number, "UNKNOWN_ID"),
        (no_name, "UNKNOWN_ID"),
        (two_names, "UNKNOWN_ID"),
        (no_best_class, "UNKNOWN_ID"),
        (nan_score, "UNKNOWN_ID"),
        (unknown_id, "UNKNOWN_ID"),
        (huge_id, "UNKNOWN_ID"),
        (duplicate_id, "DUPLICATE_ID"),
        (nan_pixel, "NOT_FINITE"),
        (far_pixel, "OUTSIDE_IMAGE"),
        (no_boxes, "TOO_FEW_POINTS"),
        (zero_stamp, "ZERO_STAMP"),
        (nameless_and_unstamped, "ZERO_STAMP"),
        (other_frame, "FRAME_MISMATCH"),
        (box_of_another_camera, "FRAME_MISMATCH"),
        (box_of_another_time, "FRAME_MISMATCH"),
    ],
)
def test_spoilt_boxes_are_refused_with_one_status_and_the_next_answered(
    vision: Estimator, spoil, outcome: str
) -> None:
    frame = detectors.boxes(vision.next_index())
    spoil(frame)

    answer = vision.expect_refusal(frame, outcome, good_frame=detectors.boxes)

    assert answer.status.header == frame.header
    assert len(vision.statuses[messages.key(frame.header.stamp)]) == 1


# ---- apriltag_msgs -------------------------------------------------------------------------------


def test_corners_of_tags_and_the_centre_of_a_single_one_give_the_pose(apriltags: Estimator) -> None:
    frame = detectors.tags(apriltags.next_index())

    answer = apriltags.expect_pose(frame)

    # Exact only if order, side, attitude and half a pixel are those of apriltag_ros.
    assert np.abs(pose_error(paper.POSE, pose_of(answer.pose.pose.pose))).max() < EXACT
    assert answer.pose.header == frame.header
    assert list(answer.status.used_ids) == [*POINT_IDS, SINGLE]


def test_noisy_tags_give_poses_as_good_as_their_covariance(
    apriltags: Estimator, rng: np.random.Generator
) -> None:
    count = 60
    nees = []
    for _ in range(count):
        pose = paper.seeded_pose(rng)
        answer = apriltags.ask(detectors.tags(apriltags.next_index(), pose, rng))
        if answer.pose is None:  # the trust test refuses one good frame in a thousand
            continue
        error = pose_error(pose, pose_of(answer.pose.pose.pose))
        nees.append(error @ np.linalg.solve(covariance_of(answer.pose), error))

    assert len(nees) >= count - 2
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * len(nees)) / len(nees)
    assert low < np.mean(nees) < high


def unknown_tag(frame: AprilTagDetectionArray) -> None:
    frame.detections[0].id = 99


def id_of_a_corner(frame: AprilTagDetectionArray) -> None:
    frame.detections[0].id = POINT_IDS[5]


def negative_tag(frame: AprilTagDetectionArray) -> None:
    frame.detections[0].id = -1


def other_family(frame: AprilTagDetectionArray) -> None:
    frame.detections[1].family = "tag16h5"


def nameless_family(frame: AprilTagDetectionArray) -> None:
    frame.detections[1].family = ""


def tag_twice(frame: AprilTagDetectionArray) -> None:
    frame.detections.append(frame.detections[0])


def nan_corner(frame: AprilTagDetectionArray) -> None:
    frame.detections[0].corners[2].y = math.nan


def infinite_centre(frame: AprilTagDetectionArray) -> None:
    frame.detections[3].centre.x = math.inf


def one_tag(frame: AprilTagDetectionArray) -> None:
    frame.detections = frame.detections[:1]


def no_tags(frame: AprilTagDetectionArray) -> None:
    frame.detections = []


def tag_zero_stamp(frame: AprilTagDetectionArray) -> None:
    frame.header.stamp = Time()


def ids_exchanged(frame: AprilTagDetectionArray) -> None:
    first, second, *_ = frame.detections
    first.id, second.id = second.id, first.id


@pytest.mark.parametrize(
    "spoil, outcome, said",
    [
        (unknown_tag, "UNKNOWN_ID", "99"),
        (id_of_a_corner, "UNKNOWN_ID", str(POINT_IDS[5])),
        (negative_tag, "UNKNOWN_ID", "-1"),
        (other_family, "UNKNOWN_ID", "tag16h5"),
        (nameless_family, "UNKNOWN_ID", "tag36h11"),
        (tag_twice, "DUPLICATE_ID", "id 0 2 times"),
        (nan_corner, "NOT_FINITE", "id 2"),
        (infinite_centre, "NOT_FINITE", f"id {SINGLE}"),
        (one_tag, "TOO_FEW_POINTS", "got 4"),
        (no_tags, "TOO_FEW_POINTS", "got 0"),
        (tag_zero_stamp, "ZERO_STAMP", "stamp"),
    ],
)
def test_spoilt_tags_are_refused_with_one_status_and_the_next_answered(
    apriltags: Estimator, spoil, outcome: str, said: str
) -> None:
    frame = detectors.tags(apriltags.next_index())
    spoil(frame)

    answer = apriltags.expect_refusal(frame, outcome, good_frame=detectors.tags)

    assert said in answer.status.message
    assert answer.status.header == frame.header
    assert len(apriltags.statuses[messages.key(frame.header.stamp)]) == 1


def test_two_tags_with_their_ids_exchanged_give_no_pose(apriltags: Estimator) -> None:
    frame = detectors.tags(apriltags.next_index())
    ids_exchanged(frame)

    answer = apriltags.ask(frame)

    assert answer.outcome in {"NOT_TRUSTED", "BEHIND_CAMERA"}, answer.status.message
    apriltags.expect_pose(detectors.tags(apriltags.next_index()))
    assert apriltags.pose_for(frame) is None


def test_tags_with_corrected_bits_are_left_out_and_named(apriltags: Estimator) -> None:
    frame = detectors.tags(apriltags.next_index())
    frame.detections[1].hamming = 1
    stranger = detectors.tags(apriltags.next_index()).detections[0]
    stranger.id, stranger.hamming = 99, 2
    frame.detections.append(stranger)

    answer = apriltags.expect_pose(frame)

    assert list(answer.status.rejected_ids) == POINT_IDS[4:8]
    assert list(answer.status.used_ids) == [*POINT_IDS[:4], *POINT_IDS[8:], SINGLE]


def test_max_hamming_lets_them_in(start_estimator: StartEstimator, tmp_path: Path) -> None:
    marker_map = detectors.write_tag_map(tmp_path / "tagged.yaml")
    estimator = start_estimator(
        *("-p", "input:=apriltags", "-p", f"marker_map:={marker_map}", "-p", "max_hamming:=1"),
        detector=APRILTAGS,
    )
    estimator.use_camera()
    frame = detectors.tags(estimator.next_index())
    frame.detections[1].hamming = 1

    answer = estimator.expect_pose(frame)

    assert list(answer.status.used_ids) == [*POINT_IDS, SINGLE]


# ---- which input ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "word, topic, kind, silent",
    [
        ("feature_points", "/feature_points", "tanker_pose/msg/FeaturePointArray", "/detections"),
        ("detections", "/detections", "vision_msgs/msg/Detection2DArray", "/feature_points"),
        (
            "apriltags",
            "/detections",
            "apriltag_msgs/msg/AprilTagDetectionArray",
            "/feature_points",
        ),
    ],
)
def test_the_node_listens_to_the_input_of_its_parameter_alone(
    start_node: StartNode, peer: Peer, word: str, topic: str, kind: str, silent: str
) -> None:
    start_node("-p", f"input:={word}")

    peer.spin_until(lambda: peer.node.count_subscribers(topic) == 1, f"a subscription to {topic}")

    (endpoint,) = peer.node.get_subscriptions_info_by_topic(topic)
    assert endpoint.topic_type == kind
    assert endpoint.qos_profile.reliability.name == "BEST_EFFORT"
    assert peer.node.count_subscribers(silent) == 0


def test_detections_can_be_remapped(start_estimator: StartEstimator) -> None:
    detector = type(VISION)(VISION.message_type, "/yolo/boxes")
    estimator = start_estimator(
        *("-p", "input:=detections", "-r", "detections:=/yolo/boxes"), detector=detector
    )
    estimator.use_camera()

    estimator.expect_pose(detectors.boxes(estimator.next_index()))


def test_an_input_that_is_none_is_refused(start_node: StartNode) -> None:
    node = start_node("-p", "input:=aruco")

    assert node.wait() != 0
    assert "feature_points, detections, apriltags" in node.log


def test_diagnostics_and_log_name_the_topic_of_the_input(
    start_node: StartNode, peer: Peer
) -> None:
    received: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
    node = start_node("-p", "input:=apriltags")

    peer.spin_until(lambda: bool(received), "diagnostics")
    peer.spin_until(lambda: "waiting for detections" in node.log, "a word of what is missing")

    assert "no detections" in received[0].status[0].message
