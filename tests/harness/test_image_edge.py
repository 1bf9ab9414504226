"""Beacons that the edge of the image cuts: rendered as discs, found as a blob detector finds them."""

import cv2
import numpy as np
import pytest

from harness import messages, paper
from harness.camera_model import Camera
from harness.conftest import StartEstimator
from harness.estimator import Estimator
from harness.messages import pose_of
from harness.peer import Peer
from harness.rotations import Array, Pose
from harness.test_parameter_services import Client

# Squares of one pixel in each direction that a rendered pixel is the mean of.
SUBPIXELS = 16
# Brighter pixels belong to a beacon, of 255.
THRESHOLD = 20


def render(centres: Array, radius_px: float, camera: Camera) -> Array:
    """An image of bright discs; what is beyond its edge is not there."""
    image = np.zeros((camera.height, camera.width))
    steps = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    reach = int(np.ceil(radius_px)) + 1
    for u, v in centres:
        for row in range(max(0, round(v) - reach), min(camera.height, round(v) + reach + 1)):
            for column in range(max(0, round(u) - reach), min(camera.width, round(u) + reach + 1)):
                du, dv = np.meshgrid(column + steps - u, row + steps - v)
                image[row, column] += np.mean(np.hypot(du, dv) <= radius_px)
    return np.round(255 * np.clip(image, 0.0, 1.0)).astype(np.uint8)


def blobs(image: Array) -> Array:
    """The centroid of every blob, weighted by brightness: what a detector of light spots does."""
    _, labels, _, _ = cv2.connectedComponentsWithStats((image > THRESHOLD).astype(np.uint8))
    rows, columns = np.indices(image.shape)
    weights = image.astype(float)
    found = []
    for label in range(1, labels.max() + 1):
        inside = labels == label
        total = weights[inside].sum()
        found.append(
            [(weights * columns)[inside].sum() / total, (weights * rows)[inside].sum() / total]
        )
    return np.array(found)


def detect(pose: Pose, radius_px: float) -> dict[int, Array]:
    """The blobs of an image, by the ids of the beacons that are nearest."""
    centres = paper.marker_pixels(pose)
    found = {}
    for blob in blobs(render(centres, radius_px, paper.CAMERA)):
        nearest = int(np.argmin(np.linalg.norm(centres - blob, axis=1)))
        found[list(paper.MARKERS)[nearest]] = blob
    return found


def poses_that_cut_marker_2(radius_px: float) -> list[Pose]:
    """The left wing tip wanders out of the image: from just uncut to three quarters gone."""
    found = []
    for centre_u in np.linspace(radius_px - 0.6, -0.4 * radius_px, 8):
        low, high = -4.0, 4.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            pose = paper.camera_from_tanker(1.0, 2.0, 1.0, (15.5, middle, 4.0))
            # The tanker farther to the left, the wing tip farther to the left in the image.
            if paper.marker_pixels(pose)[1][0] > centre_u - 0.5:
                low = middle
            else:
                high = middle
        found.append(pose)
    return found


def errors_m(
    estimator: Estimator, radius_px: float, expect_left_out: list[int]
) -> tuple[float, float]:
    """The largest error of trusted poses, and the largest of a blob's centroid, px."""
    pose_errors, blob_errors = [], []
    for pose in poses_that_cut_marker_2(radius_px):
        found = detect(pose, radius_px)
        assert 2 in found, "a part of the beacon is seen"
        truth = dict(zip(paper.MARKERS, paper.marker_pixels(pose), strict=True))
        blob_errors.append(float(np.linalg.norm(found[2] - truth[2])))
        frame = messages.feature_points(
            estimator.next_index(), np.array(list(found.values())), ids=found
        )
        answer = estimator.expect_pose(frame)
        assert list(answer.status.rejected_ids) == expect_left_out, answer.status
        assert ("edge" in answer.status.message) == bool(expect_left_out), answer.status.message
        assert answer.pose is not None
        found_pose = pose_of(answer.pose.pose.pose)
        pose_errors.append(float(np.linalg.norm(found_pose.translation - pose.translation)))
    return max(pose_errors), max(blob_errors)


def test_a_whole_beacon_is_found_where_it_is() -> None:
    found = detect(paper.POSE, 2.5)
    truth = dict(zip(paper.MARKERS, paper.marker_pixels(paper.POSE), strict=True))
    assert found.keys() == truth.keys()
    assert max(np.linalg.norm(found[marker] - truth[marker]) for marker in truth) < 0.05


def test_a_beacon_that_the_edge_cuts_is_left_out_and_its_bias_with_it(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    radius_px = 2.8
    estimator = start_estimator()
    estimator.use_camera()
    client = Client(peer)
    margin_m, moved_px = errors_m(estimator, radius_px, [2])
    assert client.set(edge_margin_px=0.0)[0].successful
    biased_m, _ = errors_m(estimator, radius_px, [])
    print(
        f"radius {radius_px} px: centroids up to {moved_px:.2f} px off; "
        f"error {100 * biased_m:.1f} cm without a margin, {100 * margin_m:.1f} cm with 3 px"
    )
    assert moved_px > 1.0 and biased_m > 0.05, "the scene is one that needs it"
    # What centroids of whole discs leave: some hundredths of a pixel.
    assert margin_m < 0.015
    assert margin_m < 0.3 * biased_m


@pytest.mark.parametrize("margin_px", [3.0, 6.0])
def test_fewer_than_a_pose_needs_are_refused_with_the_reason(
    start_estimator: StartEstimator, margin_px: float
) -> None:
    estimator = start_estimator("-p", f"edge_margin_px:={margin_px}")
    estimator.use_camera()
    inside = paper.marker_pixels(paper.POSE)
    inside[0] = [margin_px - 0.6, 200.0]
    inside[1] = [200.0, paper.CAMERA.height - 0.5 - (margin_px - 0.1)]
    frame = messages.feature_points(estimator.next_index(), inside)
    answer = estimator.expect_refusal(frame, "TOO_FEW_POINTS")
    assert sorted(answer.status.rejected_ids) == [1, 2]
    for word in ("got 4", f"{margin_px:g} px", "edge", "id 1, 2"):
        assert word in answer.status.message, answer.status.message


def test_points_computed_outside_the_image_are_taken_as_before(
    start_estimator: StartEstimator,
) -> None:
    """The paper's own wing tips are outside its image below 15 m."""
    estimator = start_estimator()
    estimator.use_camera()
    pose = paper.camera_from_tanker(0.0, 0.0, 0.0, (12.0, 0.0, 3.6))
    assert paper.marker_pixels(pose)[1][0] < -3.5
    answer = estimator.expect_pose(messages.exact_frame(estimator.next_index(), pose))
    assert not answer.status.rejected_ids and answer.status.message == ""
