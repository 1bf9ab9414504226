"""Whether a pose is the best in front of the camera: `certificate` in the status, and what requires it."""

from pathlib import Path

import pytest
from tanker_pose.msg import EstimatorStatus

from harness import messages, paper
from harness.conftest import StartEstimator
from harness.marker_maps import Markers, write_marker_map

NONE = EstimatorStatus.CERTIFICATE_NONE
CERTIFIED = EstimatorStatus.CERTIFICATE_CERTIFIED
NOT_CERTIFIED = EstimatorStatus.CERTIFICATE_NOT_CERTIFIED

# Far away, tilted by 15°, it looks much as if tilted the other way: the poses differ by 2.7 in chi-squared. A nominal
# attitude near the wrong one of the two decides against the image.
FLAT: Markers = {
    1: (0, -7, 2),
    2: (0, 7, 2),
    3: (0, -3, -2),
    4: (0, 3, -2),
    5: (0, 0, 3),
    6: (0, 0, 0),
}
NOMINAL_NEAR_THE_OTHER = ("-p", "nominal_pitch_deg:=-12.0", "-p", "max_ambiguity:=1.0")


def flat_frame(index: int):
    tilted = paper.camera_from_tanker(0, 15, 0, (60.0, 0.0, 5.0))
    pixels = paper.marker_pixels(tilted, markers=FLAT)
    return messages.feature_points(index, pixels, ids=FLAT, sigmas_px=1.0)


@pytest.mark.parametrize(
    ("parameter", "expected"),
    [("certify:=false", NONE), ("certify:=true", CERTIFIED), ("require_certificate:=true", CERTIFIED)],
)
def test_a_good_frame_is_certified_where_that_is_asked_for(
    start_estimator: StartEstimator, parameter: str, expected: int
) -> None:
    estimator = start_estimator("-p", parameter)
    estimator.use_camera()

    good = estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    few = messages.exact_frame(estimator.next_index())
    few.points = few.points[:2]
    refused = estimator.expect_refusal(few, "TOO_FEW_POINTS")

    assert good.status.certificate == expected
    assert refused.status.certificate == NONE


def test_a_pose_that_the_image_speaks_against_is_not_certified(
    start_estimator: StartEstimator, tmp_path: Path
) -> None:
    marker_map = write_marker_map(tmp_path / "flat.yaml", FLAT)
    told = ("-p", f"marker_map:={marker_map}", *NOMINAL_NEAR_THE_OTHER, "-p", "certify:=true")
    estimator = start_estimator(*told)
    estimator.use_camera()

    answer = estimator.ask(flat_frame(estimator.next_index()))

    assert answer.status.certificate == NOT_CERTIFIED
    assert answer.status.ambiguity == 1.0
    assert "certificate" not in answer.status.message


def test_a_required_certificate_that_is_missing_refuses_the_pose(
    start_estimator: StartEstimator, tmp_path: Path
) -> None:
    marker_map = write_marker_map(tmp_path / "flat.yaml", FLAT)
    required = ("-p", "require_certificate:=true")
    estimator = start_estimator(
        "-p", f"marker_map:={marker_map}", *NOMINAL_NEAR_THE_OTHER, *required
    )
    estimator.use_camera()

    frame = flat_frame(estimator.next_index())
    answer = estimator.expect_refusal(frame, "AMBIGUOUS", good_frame=None)

    assert answer.status.certificate == NOT_CERTIFIED
    assert "require_certificate" in answer.status.message
