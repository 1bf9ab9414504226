#!/usr/bin/env python3
"""Speed of the Python package: many frames in arrays, one call, OpenCV in a loop, and the same in Rust alone.

    pip install . opencv-python-headless
    cargo build --release --example many_frames
    python benches/python/compare.py [--frames 1000000] [--rust target/release/examples/many_frames]

Six points a frame, the paper's markers and camera, 0.5 px of noise. Each figure is the best of several runs.
"""

import argparse
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tanker_pose_estimator as tpe

RUNS = 3
CV_FRAMES = 3000
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


def best(work: Callable[[], object], runs: int = RUNS) -> float:
    """Seconds of the fastest run."""
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def opencv(points: np.ndarray, pixels: np.ndarray) -> float:
    """Seconds a frame of solvePnP(SQPNP) and solvePnPRefineLM in a loop."""
    import cv2

    cv2.setNumThreads(1)
    matrix = np.array([[FX, 0.0, CX], [0.0, FX, CY], [0.0, 0.0, 1.0]])
    distortion = np.zeros(4)

    def loop() -> None:
        for frame in pixels:
            _, turn, at = cv2.solvePnP(points, frame, matrix, distortion, flags=cv2.SOLVEPNP_SQPNP)
            cv2.solvePnPRefineLM(points, frame, matrix, distortion, turn, at)

    return best(loop) / len(pixels)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--rust", type=Path, help="the built example many_frames")
    options = parser.parse_args()
    map_ = tpe.MarkerMap.shipped("paper")
    camera = tpe.Camera(FX, FX, CX, CY, width=508, height=412)
    estimator = tpe.Estimator(camera, map_, edge_margin_px=0.0)
    pixels = pixels_of(options.frames, map_.points)

    records = estimator.estimate_many(pixels)
    trusted = np.mean(records["outcome"] == tpe.Outcome.OK)
    many = best(lambda: estimator.estimate_many(pixels)) / options.frames
    print(f"arrays of {options.frames} frames: {1 / many:,.0f} frames/s ({100 * trusted:.1f} % trusted)")

    one = pixels[records["outcome"] == tpe.Outcome.OK][0]

    def singly() -> None:
        for _ in range(SINGLE_CALLS):
            estimator.estimate(one)

    print(f"one call: {1e6 * best(singly) / SINGLE_CALLS:.2f} us")

    def new_one() -> None:
        for _ in range(1000):
            tpe.estimate(camera, map_, one)

    print(f"one call of estimate(), which makes an Estimator: {1e6 * best(new_one) / 1000:.1f} us")
    cv = opencv(map_.points, pixels[:CV_FRAMES])
    print(f"OpenCV in a Python loop: {1e6 * cv:.1f} us a frame, {cv / many:.0f} times as long as in arrays")
    if options.rust:
        file = Path("/dev/shm/frames.f64" if Path("/dev/shm").is_dir() else "frames.f64")
        pixels.tofile(file)
        try:
            done = subprocess.run([options.rust, file], check=True, capture_output=True, text=True)
        finally:
            file.unlink()
        rust = float(done.stdout)
        print(f"the same in Rust: {1 / rust:,.0f} frames/s; arrays take {many / rust:.2f} times as long")


if __name__ == "__main__":
    main()
