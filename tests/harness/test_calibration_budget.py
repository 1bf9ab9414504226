"""What docs/budget.md makes of an OpenCV calibration: its programs, run on simulated boards, and `solve` with their files.

The judge is the spread of many calibrations of one camera about the truth.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from harness.rotations import Array
from harness.solver import solve

PAGE = Path(__file__).parents[2] / "docs" / "budget.md"
SIZE = (1280, 960)
TRUTH = np.array([[900.0, 0, 640], [0, 900, 480], [0, 0, 1]])
LENS = np.array([-0.2, 0.05, 1e-3, -5e-4, 0.0])
NAMES = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"]
# px, of the corners.
NOISE_PX = 0.2
VIEWS = 12
CALIBRATIONS = 30


def views(rng: np.random.Generator) -> tuple[list[Array], list[Array]]:
    """Corners of a chessboard in its own plane, and in noisy images."""
    columns, rows = np.meshgrid(np.arange(9.0), np.arange(6.0))
    board = np.stack([columns.ravel(), rows.ravel(), np.zeros(54)], axis=1)
    board = (board - board.mean(axis=0)).astype(np.float32)
    boards, corners = [], []
    while len(corners) < VIEWS:
        turn = rng.normal(0.0, 0.35, 3)
        place = np.array([rng.uniform(-5, 5), rng.uniform(-4, 4), rng.uniform(9, 16)])
        exact, _ = cv2.projectPoints(board, turn, place, TRUTH, LENS)
        seen = exact.reshape(-1, 2) + rng.normal(0.0, NOISE_PX, (54, 2))
        if (seen > 0).all() and (seen < SIZE).all():
            boards.append(board)
            corners.append(seen.astype(np.float32))
    return boards, corners


def programs() -> list[str]:
    """The page's programs, in their order."""
    parts = PAGE.read_text(encoding="utf-8").split("```python\n")[1:]
    return [part.split("```")[0] for part in parts]


def run_page(seed: int, directory: Path, monkeypatch: pytest.MonkeyPatch) -> dict:
    """What the programs leave behind, and the files that they write, on one calibration."""
    boards, corners = views(np.random.default_rng([11, seed]))
    monkeypatch.chdir(directory)
    names: dict = {"boards": boards, "corners": corners, "size": SIZE}
    files = []
    for program in programs():
        exec(compile(program, str(PAGE), "exec"), names)
        files.append((directory / "calibration_budget.yaml").read_text(encoding="utf-8"))
    names["sigmas"], names["covariance"] = (json.loads(text) for text in files)
    return names


def test_programs_write_opencvs_own_standard_deviations_and_a_covariance_that_agrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    squared, stated = [], []
    for seed in range(CALIBRATIONS):
        found = run_page(seed, tmp_path, monkeypatch)
        written = found["covariance"]["covariance"]
        assert written["parameters"] == NAMES
        covariance = np.array(written["data"])
        sigmas = np.array([found["sigmas"]["sigmas"][name] for name in NAMES])
        np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sigmas, rtol=0.02)
        k, d = found["k"], found["d"].ravel()
        error = np.array([k[0, 0] - 900, k[1, 1] - 900, k[0, 2] - 640, k[1, 2] - 480, *(d - LENS)])
        squared.append(error @ np.linalg.solve(covariance, error))
        stated.append(((error / sigmas) ** 2).sum())
    # Nine numbers: 9 ± 0.8 with thirty calibrations.
    print(f"mean squared error in sigmas of the covariance {np.mean(squared):.2f}")
    assert 6.5 < np.mean(squared) < 11.5


def test_solve_takes_both_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = run_page(0, tmp_path, monkeypatch)
    camera = {
        "width": SIZE[0],
        "height": SIZE[1],
        "distortion_model": "plumb_bob",
        "d": found["d"].ravel().tolist(),
        "k": found["k"].ravel().tolist(),
    }
    markers = np.array(
        [[3.7, -7.13, 0.7], [3.7, 7.13, 0.7], [7.79, -2.69, 0.7], [7.79, 2.69, 0.7]]
        + [[7.96, 0, 3.19], [0, 0, 0]]
    )
    # x right, y down, z ahead; the tanker flies away, x ahead, y left.
    in_camera = np.stack([-markers[:, 1], -markers[:, 2] - 3, markers[:, 0] + 20], axis=1)
    pixels, _ = cv2.projectPoints(
        in_camera, np.zeros(3), np.zeros(3), found["k"], found["d"]
    )
    points = [
        {"id": index, "u": u, "v": v, "x": x, "y": y, "z": z}
        for index, ((u, v), (x, y, z)) in enumerate(
            zip(pixels.reshape(-1, 2).tolist(), markers.tolist(), strict=True)
        )
    ]
    frame = json.dumps({"camera": camera, "points": points})
    exact = solve(frame)[0]
    variances = []
    for name in ("sigmas", "covariance"):
        path = tmp_path / f"{name}.yaml"
        path.write_text(json.dumps(found[name]), encoding="utf-8")
        answer = solve(frame, arguments=("--calibration-budget-file", str(path)))[0]
        assert answer["outcome"] == "ok", answer
        assert set(answer["modes"]) == set(NAMES), answer
        variances.append(np.diag(np.reshape(answer["covariance"], (6, 6))))
        assert (variances[-1] > np.diag(np.reshape(exact["covariance"], (6, 6)))).all()
    # Coefficients that go together count less than they do one by one.
    assert variances[1][2] < variances[0][2]
