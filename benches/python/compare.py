#!/usr/bin/env python3
"""Speed of the Python package beside the same in Rust alone, OpenCV and PoseLib: the figures of docs/python.md.

    pip install . opencv-python-headless==4.11.0.86 poselib
    cargo build --release --example many_frames
    python benches/python/compare.py [--frames 1000000] [--rust target/release/examples/many_frames]

Six points a frame, the paper's markers and camera, 0.5 px of noise. All are timed in turn, in several rounds; each figure is
the best of them, so that what else the machine does counts little.
"""

import argparse
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tanker_pose_estimator as tpe

ROUNDS = 5
CV_FRAMES = 5000
SINGLE_CALLS = 20_000
FX, CX, CY = 571.0, 254.0, 206.0
OPTICAL_FROM_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def pixels_of(count: int, points: np.ndarray) -> np.ndarray:
    """Pixels (count, N, 2) of attitudes within 5 degrees, 15 m behind and 4.5 m below."""
    rng = np.random.default_rng(7)
    turn = rng.uniform(-0.09, 0.09, size=(count, 3))
    # To first order: the frames need not be of exact rotations to cost the same.
    x, y, z = points.T
    body = np.stack(
        [
            x - turn[:, 2:] * y + turn[:, 1:2] * z,
            y + turn[:, 2:] * x - turn[:, :1] * z,
            z - turn[:, 1:2] * x + turn[:, :1] * y,
        ],
        axis=-1,
    )
    at = np.array([15.0, 0.0, 4.5]) + rng.uniform(-0.5, 0.5, size=(count, 1, 3))
    seen = (body + at) @ OPTICAL_FROM_BODY.T
    pixels = FX * seen[..., :2] / seen[..., 2:] + np.array([CX, CY])
    return pixels + rng.normal(0.0, 0.5, size=pixels.shape)


def seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def opencv(points: np.ndarray, pixels: np.ndarray) -> Callable[[], None]:
    """solvePnP(SQPNP) and solvePnPRefineLM in a loop."""
    import cv2

    cv2.setNumThreads(1)
    # It makes some wheels many times slower in a virtual machine.
    cv2.ipp.setUseIPP(False)
    matrix = np.array([[FX, 0.0, CX], [0.0, FX, CY], [0.0, 0.0, 1.0]])
    distortion = np.zeros(4)

    def loop() -> None:
        for frame in pixels:
            _, turn, at = cv2.solvePnP(points, frame, matrix, distortion, flags=cv2.SOLVEPNP_SQPNP)
            cv2.solvePnPRefineLM(points, frame, matrix, distortion, turn, at)

    return loop


def poselib(points: np.ndarray, frame: np.ndarray) -> Callable[[], None]:
    """One refine_absolute_pose after another: plain least squares from the nominal pose, without a covariance."""
    import poselib

    camera = poselib.Camera("PINHOLE", [FX, FX, CX, CY], 508, 412)
    start = poselib.CameraPose()
    start.R = OPTICAL_FROM_BODY
    start.t = OPTICAL_FROM_BODY @ np.array([15.0, 0.0, 4.5])

    def loop() -> None:
        for _ in range(SINGLE_CALLS):
            poselib.refine_absolute_pose(frame, points, start, camera, {"loss_type": "TRIVIAL"})

    return loop


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--rust", type=Path, help="the built example many_frames")
    options = parser.parse_args()
    map_ = tpe.MarkerMap.shipped("paper")
    camera = tpe.Camera(FX, FX, CX, CY, width=508, height=412)
    points = map_.points
    estimator = tpe.Estimator(camera, map_, edge_margin_px=0.0)
    pixels = pixels_of(options.frames, points)
    outcomes = estimator.estimate_many(pixels)["outcome"]
    print(f"{100 * np.mean(outcomes == tpe.Outcome.OK):.2f} % of {options.frames} frames trusted")
    one = pixels[outcomes == tpe.Outcome.OK][0]

    def singly() -> None:
        for _ in range(SINGLE_CALLS):
            estimator.estimate(one)

    def of_module() -> None:
        for _ in range(SINGLE_CALLS):
            tpe.estimate(camera, points, one, edge_margin_px=0.0)

    works = {
        "arrays": (lambda: estimator.estimate_many(pixels), options.frames),
        "Estimator.estimate": (singly, SINGLE_CALLS),
        "estimate": (of_module, SINGLE_CALLS),
        "OpenCV in a loop": (opencv(points, pixels[:CV_FRAMES]), CV_FRAMES),
        "PoseLib": (poselib(points, one), SINGLE_CALLS),
    }
    times: dict[str, list[float]] = {name: [] for name in works}
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        file = Path(folder) / "frames.f64"
        pixels.tofile(file)
        for _ in range(ROUNDS):
            for name, (work, count) in works.items():
                times[name].append(seconds(work) / count)
            if options.rust:
                done = subprocess.run([options.rust, file], check=True, capture_output=True, text=True)
                times.setdefault("Rust alone", []).append(float(done.stdout))
    least = {name: min(rounds) for name, rounds in times.items()}
    for name, took_s in least.items():
        rounds = ", ".join(f"{1e6 * round_s:.3g}" for round_s in times[name])
        print(f"{name}: {1e6 * took_s:.3g} us a frame, {1 / took_s:,.0f} frames/s (rounds: {rounds} us)")
    for name, of in [("OpenCV in a loop", "arrays"), ("arrays", "Rust alone"), ("Estimator.estimate", "PoseLib")]:
        if name in least and of in least:
            print(f"{name} over {of}: {least[name] / least[of]:.3g}")


if __name__ == "__main__":
    main()
