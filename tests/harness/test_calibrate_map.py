"""`tanker_pose calibrate-map`: a recorded approach to a tanker whose markers are not where its map has them."""

import json
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from harness import paper
from harness.marker_maps import write_marker_map
from harness.processes import binary, child_environment

SURVEY_SIGMA_M = 0.05


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs a tool to its end."""
    return subprocess.run(
        [str(binary("tanker_pose")), *arguments],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )


@pytest.fixture
def flight(tmp_path: Path) -> tuple[Path, Path]:
    """An approach to a tanker that is drawn from its map's sigmas, and the map."""
    surveyed = write_marker_map(tmp_path / "tanker.yaml", paper.MARKERS, sigma_m=SURVEY_SIGMA_M)
    bag = tmp_path / "approach.mcap"
    simulated = run(
        *("simulate", "--bag", str(bag), "--marker-map", str(surveyed), "--draw-tanker"),
        *("--start-range-m", "35", "--rate-hz", "5", "--sigma-px", "0.4", "--seed", "7"),
    )
    assert simulated.returncode == 0, simulated.stderr
    return bag, surveyed


def outcomes(bag: Path, output: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Answers the recording by the node's code."""
    return run("replay", str(bag), "-o", str(output), "--ros-args", *arguments)


def test_the_refined_map_fits_its_recording_and_the_nodes_code_accepts_all_files(
    tmp_path: Path, flight: tuple[Path, Path]
) -> None:
    bag, surveyed = flight
    folder = tmp_path / "calibrated"

    done = run("calibrate-map", str(bag), "--map", str(surveyed), "-o", str(folder))

    assert done.returncode == 0, done.stderr
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert report["used_frames"] >= 0.9 * report["frames"]
    # Eighteen coordinates of which seven combinations are not told.
    assert len(report["parameters"]) == 3 * len(paper.MARKERS)
    assert sum(p["movement"] == "moved" for p in report["parameters"]) >= 2 * len(paper.MARKERS)
    shifts = [mode for mode in report["gauge"] if mode["name"].startswith("shift")]
    assert [mode["told"] for mode in shifts] == [False] * 3
    noise = report["noise"]
    assert abs(noise["sigma_px"] - 0.4) < 4.0 * noise["sigma_error_px"]

    refined = yaml.safe_load((folder / "map.yaml").read_text(encoding="utf-8"))
    assert all(0.0 < marker["sigma"] < SURVEY_SIGMA_M for marker in refined["markers"])
    assert [mode["name"] for mode in refined["flex"]][0] == "map_error_1"

    replayed = outcomes(
        bag, tmp_path / "out.mcap", "--params-file", str(folder / "parameters.yaml")
    )
    assert replayed.returncode == 0, replayed.stderr
    count = re.search(r"\bOK (\d+)", replayed.stdout)
    assert count is not None, replayed.stdout
    # One in a thousand correct frames fails the test of its residuals.
    assert int(count[1]) >= report["frames"] - 2, replayed.stdout


def test_an_exact_map_is_refused_with_what_to_state(
    tmp_path: Path, flight: tuple[Path, Path]
) -> None:
    bag, _ = flight
    done = run("calibrate-map", str(bag), "-o", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "the map has no `sigma`" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_mount_without_attitudes_stays_and_the_report_says_why(
    tmp_path: Path, flight: tuple[Path, Path]
) -> None:
    bag, surveyed = flight
    folder = tmp_path / "out"
    done = run("calibrate-map", str(bag), "--map", str(surveyed), "--mount", "-o", str(folder))
    assert done.returncode == 0, done.stderr
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    mount = [p for p in report["parameters"] if p["name"].startswith("mount")]
    assert [p["movement"] for p in mount] == ["no_attitudes"] * 3
    assert "no frame has attitudes of both aircraft" in mount[0]["reason"]
    assert "camera_mount" not in (folder / "parameters.yaml").read_text(encoding="utf-8")


def test_a_wrong_topic_is_named_with_the_one_that_the_recording_has(
    tmp_path: Path, flight: tuple[Path, Path]
) -> None:
    bag, surveyed = flight
    done = run(
        *("calibrate-map", str(bag), "--map", str(surveyed), "-o", str(tmp_path / "out")),
        *("--ros-args", "-r", "__ns:=/receiver"),
    )
    assert done.returncode == 2
    assert "/receiver/camera_info" in done.stderr
    assert "/camera_info: use -r" in done.stderr
