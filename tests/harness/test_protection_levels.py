"""`solve --protection-levels` against dense matrices of numpy on random tankers: the same to rounding."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness import integrity, paper
from harness.integrity import Budget, Levels, Probabilities
from harness.processes import REPOSITORY
from harness.rotations import Array
from harness.solver import pose_in, solve

FRAMES = 1000
# Relative. The node takes the tail from libm and steps by updates, scipy fits every hypothesis anew.
ROUNDING = 1e-6
# A subset is not judged here.
SURE = ("--trust-probability", "0.999999")
ALL_POINTS = ("--max-ambiguity", "1", "--max-outliers", "0", "--edge-margin-px", "0")


def random_tanker(rng: np.random.Generator) -> dict[int, tuple[float, float, float]]:
    """Five to twelve markers within a tanker's box."""
    count = int(rng.integers(5, 13))
    places = rng.uniform([0.0, -7.0, -1.0], [8.0, 7.0, 3.5], size=(count, 3))
    return {marker: tuple(place) for marker, place in enumerate(places, start=1)}


def frame(
    rng: np.random.Generator, number: int, markers: dict[int, tuple[float, float, float]]
) -> dict[str, Any]:
    """A noisy frame, 20 to 40 m ahead, of which one in five has a beacon a few pixels off."""
    while True:
        range_m = rng.uniform(20.0, 40.0)
        pose = paper.camera_from_tanker(
            *rng.uniform(-5.0, 5.0, size=3), (range_m, rng.uniform(-1, 1), 0.1 * range_m)
        )
        exact = paper.marker_pixels(pose, markers=markers)
        if paper.CAMERA.sees(exact, margin_px=12.0):
            break
    sigmas = rng.uniform(0.3, 0.5, size=len(markers))
    seen = exact + rng.normal(size=exact.shape) * sigmas[:, None]
    if rng.random() < 0.2:
        seen[rng.integers(len(markers))] += rng.uniform(-4.0, 4.0, size=2)
    camera = paper.CAMERA
    return {
        "id": number,
        "camera": {
            "width": camera.width,
            "height": camera.height,
            "distortion_model": camera.model,
            "d": list(camera.d),
            "k": [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1],
        },
        "points": [
            {"id": marker, "x": x, "y": y, "z": z, "u": float(u), "v": float(v), "sigma": float(s)}
            for (marker, (x, y, z)), (u, v), s in zip(markers.items(), seen, sigmas, strict=True)
        ],
    }


def fixing_one_pose(
    lines: list[dict[str, Any]], answers: list[dict[str, Any]], *arguments: str
) -> list[set[int] | None]:
    """For each frame the markers without which the others fix one pose, near that of all; None where that is unknown.

    Each is a frame of its own for `solve`, which knows nothing of protection levels then.
    """
    parts = [
        (number, point["id"], [p for p in line["points"] if p is not point])
        for number, line in enumerate(lines)
        for point in line["points"]
    ]
    found: list[set[int] | None] = [set() for _ in lines]
    requests = (
        json.dumps({"id": 0, "camera": lines[number]["camera"], "points": points})
        for number, _, points in parts
    )
    subsets = solve(*requests, arguments=(*arguments, *ALL_POINTS, "--min-points", "3", *SURE))
    for (number, marker, _), subset in zip(parts, subsets, strict=True):
        fixed = found[number]
        if fixed is None or answers[number]["outcome"] != "ok":
            continue
        if subset["outcome"] == "not_trusted":
            found[number] = None
        elif subset["outcome"] == "ok" and subset["ambiguity"] == 0.0:
            attitude = np.array(subset["covariance"]).reshape(6, 6)[3:, 3:]
            sigma = np.sqrt(np.linalg.eigvalsh(attitude)[-1])
            turned = pose_in(subset).rotation @ pose_in(answers[number]).rotation.T
            turn = np.arccos(np.clip((np.trace(turned) - 1.0) / 2.0, -1.0, 1.0))
            if sigma < np.radians(10.0) and turn < 10.0 * sigma:
                fixed.add(marker)
    return found


def expected(
    line: dict[str, Any],
    answer: dict[str, Any],
    fixing: set[int] | None,
    probabilities: Probabilities,
    point: Array,
    budget: Budget = Budget(),
) -> Levels:
    points = {p["id"]: p for p in line["points"] if p["id"] in answer["used_ids"]}
    return integrity.levels(
        pose_in(answer),
        {i: (p["x"], p["y"], p["z"]) for i, p in points.items()},
        {i: np.array([p["u"], p["v"]]) for i, p in points.items()},
        {i: p["sigma"] for i, p in points.items()},
        point,
        answer["ambiguity"],
        probabilities,
        budget,
        max_outliers=0,
        without_second_pose=fixing,
    )


def compare(answer: dict[str, Any], expected: Levels) -> str:
    """Asserts that both say the same; returns the state."""
    found = answer["integrity"]
    assert found["state"] == expected.state, found["message"]
    if expected.level is not None:
        (point,) = found["points"]
        assert np.allclose(point["protection_level"], expected.level, rtol=ROUNDING, atol=0.0)
        assert np.allclose(point["sigma"], expected.sigma, rtol=ROUNDING, atol=0.0)
        assert found["unmonitored_probability"] == pytest.approx(expected.unmonitored, rel=1e-9)
    return str(found["state"])


def test_levels_of_random_tankers_are_those_of_dense_matrices(rng: np.random.Generator) -> None:
    probabilities = Probabilities(hmi=5e-7, false_alert=1e-2, fault=3e-4)
    lines = [frame(rng, number, random_tanker(rng)) for number in range(FRAMES)]
    answers = solve(
        *map(json.dumps, lines),
        arguments=(
            *("--protection-levels", "--hmi-probability", "5e-7"),
            *("--false-alert-probability", "1e-2", "--beacon-fault-probability", "3e-4"),
            *ALL_POINTS,
        ),
    )
    fixing = fixing_one_pose(lines, answers)
    states = [
        compare(answer, expected(line, answer, fixed, probabilities, np.zeros(3)))
        for line, answer, fixed in zip(lines, answers, fixing, strict=True)
        if answer["outcome"] == "ok" and fixed is not None
    ]
    print({state: states.count(state) for state in states})
    # Each state is compared often enough to matter.
    assert states.count("available") > FRAMES / 3
    assert states.count("unmonitored") > FRAMES / 50
    assert states.count("fault") > FRAMES / 100


def test_levels_with_an_error_budget_are_those_of_dense_matrices(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    shape = {1: (0.0, 0.0, 1.0), 2: (0.0, 0.0, 1.0), 3: (0.0, 0.0, 0.14), 4: (0.0, 0.0, 0.14)}
    markers = {**paper.MARKERS, 7: (4.0, -3.5, 0.5), 8: (4.0, 3.5, 0.5)}
    map_file = tmp_path / "map.yaml"
    listed = "".join(f"  - {{id: {i}, x: {x}, y: {y}, z: {z}}}\n" for i, (x, y, z) in markers.items())
    bent = "".join(f"      - {{id: {i}, z: {z}}}\n" for i, (_, _, z) in shape.items())
    map_file.write_text(
        f"name: bent\nsigma: 0.02\nmarkers:\n{listed}"
        f"flex:\n  - name: wing\n    sigma: 0.2\n    shape:\n{bent}"
        "points:\n  - {name: tail, x: 7.8, y: 0.0, z: 1.0}\n",
        encoding="utf-8",
    )
    budget = Budget(
        survey_m=0.02,
        flex=[{i: 0.2 * np.array(s) for i, s in shape.items()}],
        focal_length=0.003,
    )
    probabilities = Probabilities(flex_fault=1e-5)
    lines = [frame(rng, number, markers) for number in range(FRAMES // 5)]
    answers = solve(
        *map(json.dumps, lines),
        arguments=(
            *("--marker-map", str(map_file), "--protection-levels"),
            *("--focal-length-sigma", "0.003", "--flex-fault-probability", "1e-5"),
            *ALL_POINTS,
        ),
    )
    of_budget = ("--marker-map", str(map_file), "--focal-length-sigma", "0.003")
    fixing = fixing_one_pose(lines, answers, *of_budget)
    tail = np.array([7.8, 0.0, 1.0])
    states = [
        compare(answer, expected(line, answer, fixed, probabilities, tail, budget))
        for line, answer, fixed in zip(lines, answers, fixing, strict=True)
        if answer["outcome"] == "ok" and fixed is not None
    ]
    assert states.count("available") > FRAMES / 10


def test_a_refuelling_setup_brings_receptacle_mount_and_alert_limits(tmp_path: Path) -> None:
    example = (REPOSITORY / "config/refuelling/example.yaml").read_text(encoding="utf-8")
    strict = tmp_path / "strict.yaml"
    limit = "alert_limit: {ahead_m: 5.0, lateral_m: 0.01, vertical_m: 5.0}\n"
    strict.write_text(f"{example}\n{limit}", encoding="utf-8")
    pixels = paper.marker_pixels(paper.POSE)
    points = [
        {"id": marker, "u": float(u), "v": float(v), "sigma": 0.5}
        for marker, (u, v) in zip(paper.MARKERS, pixels, strict=True)
    ]
    camera = {"width": 508, "height": 412, "k": [571, 0, 254, 0, 571, 206, 0, 0, 1]}
    line = json.dumps({"id": 1, "camera": camera, "points": points})

    def of(*arguments: str) -> dict[str, Any]:
        (answer,) = solve(
            line, arguments=("--marker-map", "paper", "--protection-levels", *arguments)
        )
        return dict(answer["integrity"])

    alone = of()
    assert [point["name"] for point in alone["points"]] == ["markers_mean"]
    with_setup = of("--refuelling", str(strict))
    assert [point["name"] for point in with_setup["points"]] == ["receptacle"]
    assert with_setup["state"] == "above_limit"
    assert "the lateral protection level of receptacle is" in with_setup["message"]
    assert "allowed is 0.01 m" in with_setup["message"]
    # 0.1 deg of the mount at 15 m are 2.6 cm, with the position's 5 mm and the receptacle's 2 cm.
    (receptacle,) = with_setup["points"]
    assert receptacle["sigma"][1] > np.hypot(np.radians(0.1) * 11.0, 0.02)
