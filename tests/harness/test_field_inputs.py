"""Inputs that users met: what is sound is read and right, what is not is refused in their words."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from harness.processes import binary, child_environment
from harness.solver import solve

FIELD = Path(__file__).parent / "fixtures" / "field"

# m; the pixels are exact to rounding of a few digits in the coefficients.
EXACT_M = 1e-3


def solved(name: str) -> dict:
    text = json.dumps(json.loads((FIELD / name).read_text(encoding="utf-8")))
    (answer,) = solve(text, arguments=("--marker-map", "paper"))
    return answer


def test_a_rational_lens_whose_polynomials_nearly_cancel_is_solved() -> None:
    answer = solved("rational_nearly_cancelling.json")
    assert answer["outcome"] == "ok", answer["message"]
    assert np.allclose(answer["translation"], [0.2, -0.5, 19.0], atol=EXACT_M)


@pytest.mark.parametrize(
    ("name", "spelt"),
    [
        ("plumb_bob_trailing_zeros.json", lambda d: d[:5]),
        ("rational_five_coefficients.json", lambda d: [*d, 0, 0, 0]),
    ],
)
def test_coefficients_that_are_zero_may_stand_or_not(name: str, spelt) -> None:
    answer = solved(name)
    assert answer["outcome"] == "ok", answer["message"]
    frame = json.loads((FIELD / name).read_text(encoding="utf-8"))
    frame["camera"]["d"] = spelt(frame["camera"]["d"])
    (same,) = solve(json.dumps(frame), arguments=("--marker-map", "paper"))
    assert same == answer


def test_a_principal_point_far_outside_the_image_is_refused_with_the_reason() -> None:
    answer = solved("principal_point_outside.json")
    assert answer["outcome"] == "invalid_camera_info"
    assert "(1223.5, 1024.5) of k lies more than one image size outside" in answer["message"]


def camera_file(path: Path | str) -> subprocess.CompletedProcess[str]:
    """One frame without a camera of its own, solved with a calibration file."""
    frame = json.loads((FIELD / "plumb_bob_trailing_zeros.json").read_text(encoding="utf-8"))
    for point in frame["points"]:  # into an image of 640 x 480
        point["u"], point["v"] = point["u"] / 2, point["v"] / 2
    del frame["camera"]
    return subprocess.run(
        [binary("tanker_pose"), "solve", "--marker-map", "paper", "--camera", str(path)],
        input=json.dumps(frame) + "\n",
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )


@pytest.mark.parametrize(
    ("name", "warning"),
    [
        ("camera_as_ros_writes_it.yaml", ""),
        ("camera_d_as_column.yaml", ""),
        ("camera_yaml_directive.yaml", ""),
        ("camera_without_model.yaml", "no distortion_model, plumb_bob assumed"),
    ],
)
def test_calibration_files_that_ros_reads_are_read(name: str, warning: str) -> None:
    result = camera_file(FIELD / name)
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    # The frame is not of this camera: what counts is that it was understood.
    assert answer["outcome"] in {"ok", "not_trusted"}, answer
    assert (warning in result.stderr) if warning else not result.stderr


def test_two_cameras_in_one_file_are_refused_in_a_users_words() -> None:
    result = camera_file(FIELD / "camera_two_documents.yaml")
    assert result.returncode != 0
    assert "expected one document, got a second one after `---`" in result.stderr
    assert "from_str" not in result.stderr


@pytest.mark.parametrize("option", ["--camera", "--marker-map"])
def test_a_file_that_never_ends_is_refused_at_once(option: str) -> None:
    result = subprocess.run(
        [binary("tanker_pose"), "solve", option, "/dev/zero"],
        stdin=subprocess.DEVNULL,
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=10.0,
        check=False,
    )
    assert result.returncode != 0
    assert "expected a text file of at most 4194304 bytes, got more" in result.stderr


def test_a_line_that_is_too_long_is_answered_and_the_next_one_solved() -> None:
    good = (FIELD / "plumb_bob_trailing_zeros.json").read_text(encoding="utf-8").strip()
    long, answer = solve(
        json.dumps({"id": "x" * 3_000_000}), good, arguments=("--marker-map", "paper")
    )
    assert long["outcome"] == "malformed"
    assert "line 1: expected at most 1048576 bytes" in long["message"]
    assert answer["outcome"] == "ok"


def test_unknown_keys_of_a_line_are_refused_by_name() -> None:
    frame = json.loads((FIELD / "plumb_bob_trailing_zeros.json").read_text(encoding="utf-8"))
    (answer,) = solve(json.dumps(frame | {"pionts": []}), arguments=("--marker-map", "paper"))
    assert answer["outcome"] == "malformed"
    assert "pionts" in answer["message"]


def test_a_pasted_camera_info_of_either_ros_is_read() -> None:
    frame = json.loads((FIELD / "plumb_bob_trailing_zeros.json").read_text(encoding="utf-8"))
    camera = frame["camera"]
    header = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "camera"}
    k, d = camera.pop("k"), camera.pop("d")
    p = [*k[:3], 0, *k[3:6], 0, *k[6:], 0]
    r = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    ros2 = camera | {"header": header, "k": k, "d": d, "r": r, "p": p, "binning_x": 0}
    ros1 = camera | {"header": header, "K": k, "D": d, "R": r, "P": p, "binning_x": 0}
    lines = [json.dumps(frame | {"camera": pasted}) for pasted in (ros2, ros1)]
    first, second = solve(*lines, arguments=("--marker-map", "paper"))
    assert first["outcome"] == "ok", first["message"]
    assert first == second
