"""A CameraInfo means what REP 104 says: lenses, regions, binning, rectified images, changes."""

from dataclasses import replace

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, RegionOfInterest
from tanker_pose.msg import FeaturePointArray

from harness import messages, paper
from harness.camera_model import LENSES, Camera
from harness.conftest import StartEstimator
from harness.consistency import pose_error
from harness.estimator import Answer, Estimator
from harness.messages import pose_of

# As in test_estimation: well inside what a thousandth of a standard deviation amounts to.
EXACT = 3e-4


def error_of(answer: Answer) -> float:
    assert answer.pose is not None
    return float(np.abs(pose_error(paper.POSE, pose_of(answer.pose.pose.pose))).max())


@pytest.mark.parametrize("model", LENSES)
def test_a_distorted_image_gives_the_exact_pose(
    start_estimator: StartEstimator, model: str
) -> None:
    camera = replace(paper.CAMERA, model=model, d=LENSES[model])
    straight = paper.marker_pixels(paper.POSE)
    bent = paper.marker_pixels(paper.POSE, camera)
    assert np.abs(bent - straight).max() > 3.0, "this lens would not show whether it is modelled"
    estimator = start_estimator()
    estimator.use_camera(messages.camera_info(camera))

    answer = estimator.expect_pose(messages.exact_frame(estimator.next_index(), camera=camera))

    assert error_of(answer) < EXACT


@pytest.mark.parametrize("model", ["", "plumb_bob", "lens_by_committee"])
def test_without_coefficients_the_model_does_not_matter(
    start_estimator: StartEstimator, model: str
) -> None:
    info = messages.camera_info()
    info.distortion_model = model
    info.d = []
    estimator = start_estimator()
    estimator.use_camera(info)

    assert error_of(estimator.expect_pose(messages.exact_frame(estimator.next_index()))) < EXACT


def test_rectified_uses_p_and_no_distortion(start_estimator: StartEstimator) -> None:
    rectified = replace(paper.CAMERA, fx=540.0, fy=550.0, cx=250.0, cy=200.0)
    info = messages.camera_info(replace(paper.CAMERA, d=LENSES["plumb_bob"]))
    info.p = messages.camera_info(rectified).p
    estimator = start_estimator("-p", "rectified:=true")
    estimator.use_camera(info)

    answer = estimator.expect_pose(messages.exact_frame(estimator.next_index(), camera=rectified))

    assert error_of(answer) < EXACT


@pytest.mark.parametrize("rectified", [False, True], ids=["raw", "rectified"])
def test_region_and_binning_shift_and_scale_the_pixels(
    start_estimator: StartEstimator, rectified: bool
) -> None:
    sensor = replace(paper.CAMERA, width=1016, height=824, fx=1142.0, fy=1142.0, cx=508.0, cy=412.0)
    info = messages.camera_info(sensor)
    info.binning_x, info.binning_y = 2, 4
    info.roi = RegionOfInterest(
        x_offset=30, y_offset=10, width=960, height=400, do_rectify=rectified
    )
    pixels = (paper.marker_pixels(paper.POSE, sensor) - [30, 10]) / [2, 4]
    estimator = start_estimator("-p", f"rectified:={str(rectified).lower()}")
    estimator.use_camera(info)

    answer = estimator.expect_pose(messages.feature_points(estimator.next_index(), pixels))

    assert error_of(answer) < EXACT


def test_pixels_are_judged_against_the_region_that_was_read_out(
    start_estimator: StartEstimator,
) -> None:
    info = messages.camera_info()
    info.roi = RegionOfInterest(x_offset=0, y_offset=0, width=508, height=100)
    estimator = start_estimator()
    estimator.use_camera(info)
    frame = messages.exact_frame(estimator.next_index())
    frame.points[0].v = 100_000.0

    estimator.expect_refusal(frame, "OUTSIDE_IMAGE")


def test_a_zoom_while_running_is_followed(estimator: Estimator) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    zoomed = replace(paper.CAMERA, fx=500.0, fy=500.0)

    estimator.info_publisher.publish(messages.camera_info(zoomed))

    def frame(index: int) -> FeaturePointArray:
        return messages.exact_frame(index, camera=zoomed)

    def right(answer: Answer) -> bool:
        return answer.outcome == "OK" and error_of(answer) < EXACT

    estimator.ask_until(frame, right, "poses with the new focal length")


def test_a_camera_info_of_another_frame_moves_the_expected_frame_id(estimator: Estimator) -> None:
    info: CameraInfo = messages.camera_info(frame_id="left_camera_optical")
    estimator.info_publisher.publish(info)

    def frame(index: int) -> FeaturePointArray:
        return messages.feature_points(
            index, paper.marker_pixels(paper.POSE), frame_id="left_camera_optical"
        )

    answer = estimator.ask_until(frame, lambda a: a.outcome == "OK", "poses in the other frame")

    assert answer.pose is not None
    assert answer.pose.header.frame_id == "left_camera_optical"


def test_the_fisheye_of_a_wide_lens_is_inverted_far_from_the_axis(
    start_estimator: StartEstimator,
) -> None:
    wide = Camera(220.0, 220.0, 254.0, 206.0, 508, 412, "equidistant", LENSES["equidistant"])
    near = paper.camera_from_tanker(2.0, -3.0, 1.0, (4.0, 0.0, 3.0))
    pixels = paper.marker_pixels(near, wide)
    estimator = start_estimator()
    estimator.use_camera(messages.camera_info(wide))

    answer = estimator.expect_pose(messages.feature_points(estimator.next_index(), pixels))

    assert answer.pose is not None
    assert np.abs(pose_error(near, pose_of(answer.pose.pose.pose))).max() < EXACT
