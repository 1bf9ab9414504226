"""`tanker_pose evaluate`: a bag with known errors, judged; numpy and scipy must agree, and a browser shows the page."""

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from playwright.sync_api import sync_playwright
from rosbags.rosbag2 import StoragePlugin
from scipy.stats import binomtest, chi2
from sensor_msgs.msg import CameraInfo
from tanker_pose.msg import EstimatorStatus, FeaturePointArray, Integrity, IntegrityPoint

from harness import messages, paper
from harness.bags import BagWriter, approach
from harness.consistency import cramer_rao_covariance, moved, nees, pose_error
from harness.processes import binary, child_environment
from harness.rotations import Array, Pose, to_quaternion

FRAMES = 300
SEED = 20261130
# Truth minus estimate along x, m: about one sigma far away, and several near the tanker.
BIAS_X_M = 0.03
# Marker 3, tanker frame, m.
DISPLACED, DISPLACEMENT_M = 3, np.array([0.06, -0.10, 0.08])
# Every 25th frame is refused.
REFUSED_EVERY = 25
# From an image's stamp to its answer, ns: the node's, and what it varies by.
DELAY_NS, DELAY_JITTER_NS = 30_000_000, 10_000_000
# Frames that the camera leaves out once, and how far its clock is behind the recorder's.
GAP_AT, GAP_FRAMES = 200, 7
CLOCK_OFFSET_NS = 5_000_000
POINT = "markers_mean"

BROWSER = shutil.which("chromium-headless-shell") or shutil.which("chromium")
BROWSER_FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--no-first-run", "--disable-component-update", "--disable-sync"),
]
PLOTS = {
    *(f"error-time-{axis}" for axis in range(6)),
    *("error-range-0", "error-range-3", "nees", "integrity-time", "outcomes-time"),
    *(f"stanford-{POINT}-{axis}" for axis in ("ahead", "lateral", "vertical")),
    *("residual-mean", "residual-chi", "stamp-steps", "log-minus-stamp", "modes-time"),
}


@dataclass
class Known:
    """What was written, in the order of the frames with a pose."""

    truths: list[Pose]
    estimates: list[Pose]
    covariances: list[Array]
    residuals: dict[int, list[Array]]
    levels: list[Array]
    delays_s: list[float]
    refused: int


def message_of(pose: Pose) -> PoseMessage:
    """A pose as its message."""
    x, y, z = pose.translation
    qx, qy, qz, qw = to_quaternion(pose.rotation)
    return PoseMessage(
        position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw)
    )


def write_bag(path: Path) -> Known:
    """An approach whose estimates have the covariance that they state, and a bias along x."""
    rng = np.random.default_rng(SEED)
    topics = {
        "/camera_info": CameraInfo,
        "/feature_points": FeaturePointArray,
        "/truth": PoseStamped,
        "/pose": PoseWithCovarianceStamped,
        "/status": EstimatorStatus,
        "/integrity": Integrity,
    }
    bag = BagWriter(path, StoragePlugin.MCAP, topics)
    markers = dict(paper.MARKERS)
    markers[DISPLACED] = tuple(np.array(markers[DISPLACED]) + DISPLACEMENT_M)
    known = Known([], [], [], {marker: [] for marker in markers}, [], [], 0)
    for index, truth in enumerate(approach(FRAMES)):
        image = index + (GAP_FRAMES if index >= GAP_AT else 0)
        pixels = paper.marker_pixels(truth, markers=markers)
        pixels = pixels + rng.normal(0.0, messages.SIGMA_PX, pixels.shape)
        frame = messages.feature_points(image, pixels)
        header = frame.header
        seen_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec + CLOCK_OFFSET_NS
        delay_ns = DELAY_NS + int(rng.integers(DELAY_JITTER_NS))
        bag.write("/camera_info", seen_ns, messages.camera_info())
        bag.write("/feature_points", seen_ns, frame)
        bag.write("/truth", seen_ns, PoseStamped(header=header, pose=message_of(truth)))
        status = EstimatorStatus(header=header, used_ids=list(paper.MARKERS))
        status.mode_names, status.mode_amplitudes = ["wing"], [float(np.sin(0.1 * index))]
        status.solve_time.nanosec = 1000 + index
        if index % REFUSED_EVERY == 0:
            status.outcome = EstimatorStatus.NOT_TRUSTED
            known.refused += 1
            bag.write("/status", seen_ns + delay_ns, status)
            continue
        covariance = cramer_rao_covariance(
            truth, paper.MARKERS, paper.CAMERA, np.full(len(markers), messages.SIGMA_PX)
        )
        error = rng.multivariate_normal(np.zeros(6), covariance)
        error[0] += BIAS_X_M
        estimate = moved(truth, -error)
        stated = PoseWithCovarianceStamped(header=header)
        stated.pose.pose = message_of(estimate)
        stated.pose.covariance = covariance.ravel()
        bag.write("/pose", seen_ns + delay_ns, stated)
        bag.write("/status", seen_ns + delay_ns, status)
        # Some levels are too small, some beyond the alert limit.
        level = rng.uniform(0.02, 0.5, 3)
        point = IntegrityPoint(name=POINT, sigma=Vector3())
        point.protection_level = Vector3(x=level[0], y=level[1], z=level[2])
        point.alert_limit = Vector3(x=0.4, y=0.4, z=0.4)
        state = Integrity.ABOVE_LIMIT if (level > 0.4).any() else Integrity.AVAILABLE
        bag.write("/integrity", seen_ns + delay_ns, Integrity(header=header, state=state, points=[point]))
        known.truths.append(truth)
        known.estimates.append(estimate)
        known.covariances.append(covariance)
        known.levels.append(level)
        known.delays_s.append((CLOCK_OFFSET_NS + delay_ns) * 1e-9)
        for row, marker in enumerate(markers):
            predicted = paper.marker_pixels(estimate)[row]
            known.residuals[marker].append(pixels[row] - predicted)
    bag.close()
    return known


@dataclass
class Judged:
    """A bag, what is known of it, and what `evaluate` says."""

    known: Known
    folder: Path
    report: Any


def evaluate(bag: Path, folder: Path, *options: str, code: int = 0) -> str:
    """Runs the tool; what it says on standard error."""
    done = subprocess.run(
        [str(binary("tanker_pose")), "evaluate", str(bag), "-o", str(folder), *options],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == code, done.stderr
    return done.stderr


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> Judged:
    folder = tmp_path_factory.mktemp("evaluate")
    known = write_bag(folder / "flight")
    evaluate(folder / "flight", folder / "report")
    text = (folder / "report" / "evaluation.json").read_text(encoding="utf-8")
    return Judged(known, folder / "report", json.loads(text))


def errors_of(known: Known) -> Array:
    """One row a frame."""
    pairs = zip(known.truths, known.estimates, strict=True)
    return np.array([pose_error(truth, estimate) for truth, estimate in pairs])


def test_errors_and_coverage_of_each_axis_are_those_of_numpy(judged: Judged) -> None:
    errors = errors_of(judged.known)
    sigmas = np.sqrt([np.diag(covariance) for covariance in judged.known.covariances])
    for axis, found in enumerate(judged.report["pose"]["axes"]):
        assert found["mean"] == pytest.approx(errors[:, axis].mean(), rel=1e-6, abs=1e-12)
        assert found["rms"] == pytest.approx(np.sqrt((errors[:, axis] ** 2).mean()), rel=1e-6)
        assert found["sigma"] == pytest.approx(np.sqrt((sigmas[:, axis] ** 2).mean()), rel=1e-9)
        within = int((np.abs(errors[:, axis]) <= 3.0 * sigmas[:, axis]).sum())
        assert found["within_3_sigma"] == within
        interval = binomtest(within, len(errors)).proportion_ci()
        assert found["coverage_interval_if_independent"] == pytest.approx(
            [interval.low, interval.high], abs=1e-6
        )
    # The bias is an error of x, truth minus estimate, and of no other axis.
    bias = judged.report["pose"]["axes"][0]
    assert bias["axis"] == "x_m"
    assert abs(bias["mean"] - BIAS_X_M) < 4.0 * sigmas[:, 0].max() / np.sqrt(len(errors))


def test_nees_and_its_bounds_are_those_of_scipy_and_the_bias_is_found(judged: Judged) -> None:
    known = judged.known
    frames = zip(known.truths, known.estimates, known.covariances, strict=True)
    values = np.array([nees(*frame) for frame in frames])
    found = judged.report["pose"]["nees"]
    assert found["mean"] == pytest.approx(values.mean(), rel=1e-6)
    assert found["max"] == pytest.approx(values.max(), rel=1e-6)
    count = len(values)
    assert found["bounds_if_independent"] == pytest.approx(
        chi2.ppf([0.025, 0.975], 6 * count) / count, rel=1e-5
    )
    independent = found["independent_frames"]
    assert found["bounds"] == pytest.approx(
        chi2.ppf([0.025, 0.975], 6 * independent) / independent, rel=1e-4
    )
    # What stays the same over all frames makes them worth fewer, and this bias is too large even so.
    assert 1.0 <= independent < count
    assert found["verdict"] == "too_high"
    worst = judged.report["pose"]["worst_frames"]
    assert [frame["nees"] for frame in worst] == pytest.approx(sorted(values)[-1:-11:-1], rel=1e-6)


def test_displaced_marker_is_named_with_its_displacement(judged: Judged) -> None:
    found = judged.report["residuals"]
    assert found["suspect"]["id"] == DISPLACED
    for marker in found["markers"]:
        residuals = np.array(judged.known.residuals[marker["id"]])
        assert marker["frames"] == len(residuals)
        assert marker["mean_px"] == pytest.approx(residuals.mean(axis=0), abs=1e-6)
        assert marker["sigma_px"] == pytest.approx(residuals.std(axis=0, ddof=1), rel=1e-6)
    moved_by = next(marker for marker in found["markers"] if marker["id"] == DISPLACED)
    off = (np.array(moved_by["displacement_m"]) - DISPLACEMENT_M) / moved_by["displacement_sigma_m"]
    # Three numbers within four sigmas: wrong once in five thousand.
    assert np.abs(off).max() < 4.0
    assert np.max(moved_by["displacement_sigma_m"]) < 0.05


def test_stanford_counts_are_those_of_numpy(judged: Judged) -> None:
    known = judged.known
    mean = np.mean(list(paper.MARKERS.values()), axis=0)
    pairs = zip(known.truths, known.estimates, strict=True)
    off = np.array([truth.transform(mean[None])[0] - found.transform(mean[None])[0] for truth, found in pairs])
    errors = np.abs(off @ paper.CAMERA_FROM_RECEIVER)
    levels = np.array(known.levels)
    for axis, found in enumerate(judged.report["integrity"]["stanford"]):
        error, level = errors[:, axis], levels[:, axis]
        available, exceeds = level <= 0.4, error > level
        assert found["nominal"] == (available & ~exceeds).sum()
        assert found["unavailable"] == (~available & ~exceeds).sum()
        assert found["misleading"] == (available & exceeds & (error <= 0.4)).sum()
        assert found["hazardous"] == (available & exceeds & (error > 0.4)).sum()
        assert found["unavailable_and_misleading"] == (~available & exceeds).sum()
    available = (levels <= 0.4).all(axis=1).mean()
    assert judged.report["integrity"]["availability"] == pytest.approx(available)


def test_refusals_delays_gaps_and_clocks_are_those_written(judged: Judged) -> None:
    report, known = judged.report, judged.known
    counts = {count["name"]: count["count"] for count in report["outcomes"]["counts"]}
    assert counts == {"OK": FRAMES - known.refused, "NOT_TRUSTED": known.refused}
    delay = report["latency"]["pose_log_minus_stamp_s"]
    expected = np.percentile(known.delays_s, [50, 99, 100])
    assert [delay["p50"], delay["p99"], delay["max"]] == pytest.approx(expected, abs=1e-9)
    solve = np.percentile(1e-9 * (1000 + np.arange(FRAMES)), [50, 99, 100])
    found = report["latency"]["solve_time_s"]
    assert [found["p50"], found["p99"], found["max"]] == pytest.approx(solve, abs=1e-12)
    stamps = next(one for one in report["stamps"] if one["role"] == "detections")
    period_s = messages.FRAME_PERIOD_NS * 1e-9
    assert stamps["period_s"] == pytest.approx(period_s, abs=1e-9)
    assert stamps["gaps"] == 1
    assert stamps["longest_gap_s"] == pytest.approx((GAP_FRAMES + 1) * period_s, abs=1e-9)
    assert stamps["log_minus_stamp_median_s"] == pytest.approx(CLOCK_OFFSET_NS * 1e-9, abs=1e-9)
    assert (stamps["out_of_order"], stamps["repeated"]) == (0, 0)


def test_trajectories_hold_every_pose_and_covariance(judged: Judged) -> None:
    estimate = np.loadtxt(judged.folder / "estimate.tum")
    assert estimate[:, 1:4] == pytest.approx(
        np.array([pose.translation for pose in judged.known.estimates])
    )
    assert len(np.loadtxt(judged.folder / "truth.tum")) == FRAMES
    lines = (judged.folder / "velocity_and_covariance.csv").read_text(encoding="utf-8").splitlines()
    triangle = np.triu_indices(6)
    numbers = [[float(value) for value in line.split(",")[8:]] for line in lines[1:]]
    expected = [covariance[triangle] for covariance in judged.known.covariances]
    assert np.array(numbers) == pytest.approx(np.array(expected))


def test_two_runs_write_the_same_bytes(judged: Judged, tmp_path: Path) -> None:
    evaluate(judged.folder.parent / "flight", tmp_path)
    for path in judged.folder.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


OVERLAPS = """() => [...document.querySelectorAll('svg')].flatMap(svg => {
  const boxes = [...svg.querySelectorAll('text')].map(text => [text.textContent, text.getBoundingClientRect()]);
  const apart = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1 || a.bottom <= b.top + 2 || b.bottom <= a.top + 2;
  return boxes.flatMap(([a, first], i) => boxes.slice(i + 1)
    .filter(([b, second]) => !apart(first, second)).map(([b]) => svg.parentElement.dataset.plot + ': ' + a + ' / ' + b));
})"""
OUTSIDE = """() => [...document.querySelectorAll('svg text')].filter(text => {
  const [inner, outer] = [text, text.closest('svg')].map(found => found.getBoundingClientRect());
  return inner.left < outer.left - 1 || inner.right > outer.right + 1 || inner.bottom > outer.bottom + 1;
}).map(text => text.textContent)"""


def test_browser_shows_every_plot_without_an_error_or_an_overlap(judged: Judged) -> None:
    assert BROWSER is not None, "install chromium-headless-shell or chromium"
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=BROWSER_FLAGS)
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("requestfailed", lambda request: complaints.append(request.url))
        page.goto((judged.folder / "evaluation.html").as_uri())
        sizes = page.evaluate(
            "() => [...document.querySelectorAll('[data-plot] svg')].map(svg =>"
            " [svg.parentElement.dataset.plot, svg.getBoundingClientRect().width, svg.querySelectorAll('path').length])"
        )
        overlaps, outside = page.evaluate(OVERLAPS), page.evaluate(OUTSIDE)
        text = page.inner_text("body")
        browser.close()
    assert complaints == []
    assert {name for name, _, _ in sizes} == PLOTS
    assert all(width > 300 and paths > 8 for _, width, paths in sizes), sizes
    assert overlaps == [] and outside == []
    assert f"Marker {DISPLACED} is not where the map has it" in text


def test_cut_bag_is_read_up_to_the_cut_and_a_missing_truth_is_named(judged: Judged, tmp_path: Path) -> None:
    (whole,) = (judged.folder.parent / "flight").glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    words = evaluate(cut, tmp_path / "cut", "--truth", "/no_such_truth", code=1)
    assert "cut off" in words and "/no_such_truth" in words
    report = json.loads((tmp_path / "cut" / "evaluation.json").read_text(encoding="utf-8"))
    assert report["pose"] is None and report["residuals"]["suspect"]["id"] == DISPLACED
    assert 0 < report["outcomes"]["frames"] < FRAMES
