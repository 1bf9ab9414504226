"""Worker of the peers benchmark: OpenCV and PoseLib as Python calls, and the calls alone.

worker.py FRAMES answers the same lines as the Rust worker: methods, time, poses.
"""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import poselib

from frames import Frame, read

BLOCK_S = 4e-3

camera, sizes = read(Path(sys.argv[1]))
cv2.setNumThreads(1)
K = np.array([[camera[0], 0, camera[2]], [0, camera[1], camera[3]], [0, 0, 1]])
POSELIB_CAMERA = poselib.Camera("PINHOLE", list(camera), 508, 412)
# Plain least squares; the default is robust.
LEAST_SQUARES = {"loss_type": "TRIVIAL"}
NO_WORK = LEAST_SQUARES | {"max_iterations": 0}


class Prepared:
    """A frame in the types that the peers take."""

    def __init__(self, frame: Frame) -> None:
        self.markers = np.ascontiguousarray(frame.markers)
        self.pixels = np.ascontiguousarray(frame.pixels)
        self.prior_rotation = cv2.Rodrigues(frame.prior_rotation)[0]
        self.prior_translation = frame.prior_translation.reshape(3, 1).copy()
        self.poselib_prior = poselib.CameraPose()
        self.poselib_prior.R = frame.prior_rotation
        self.poselib_prior.t = frame.prior_translation


def opencv(flag: int, refine: bool) -> Callable:
    def solve(frame: Prepared):
        found, rotation, translation = cv2.solvePnP(
            frame.markers, frame.pixels, K, None, flags=flag
        )
        if found and refine:
            rotation, translation = cv2.solvePnPRefineLM(
                frame.markers, frame.pixels, K, None, rotation, translation
            )
        return (rotation, translation) if found else None

    return solve


def iterative(frame: Prepared):
    found, rotation, translation = cv2.solvePnP(
        frame.markers,
        frame.pixels,
        K,
        None,
        frame.prior_rotation.copy(),
        frame.prior_translation.copy(),
        True,
        cv2.SOLVEPNP_ITERATIVE,
    )
    return (rotation, translation) if found else None


def one_point(frame: Prepared):
    """As many arrays in and out as solvePnP, the work of one point."""
    return cv2.projectPoints(
        frame.markers[:1], frame.prior_rotation, frame.prior_translation, K, None
    )


def poselib_refine(options: dict) -> Callable:
    def solve(frame: Prepared):
        return poselib.refine_absolute_pose(
            frame.pixels, frame.markers, frame.poselib_prior, POSELIB_CAMERA, options
        )[0]

    return solve


METHODS: dict[str, Callable] = {
    "py_cv_sqpnp": opencv(cv2.SOLVEPNP_SQPNP, refine=False),
    "py_cv_sqpnp_lm": opencv(cv2.SOLVEPNP_SQPNP, refine=True),
    "py_cv_epnp": opencv(cv2.SOLVEPNP_EPNP, refine=False),
    "py_cv_iterative": iterative,
    "py_poselib": poselib_refine(LEAST_SQUARES),
    "call_opencv": one_point,
    "call_poselib": poselib_refine(NO_WORK),
}

prepared = [[Prepared(frame) for frame in frames] for frames in sizes]


def ns_per_solve(solve: Callable, frames: list[Prepared]) -> float:
    def once() -> None:
        for frame in frames:
            solve(frame)

    once()
    begin, passes = time.thread_time(), 0
    while time.thread_time() - begin < BLOCK_S:
        once()
        passes += 1
    return (time.thread_time() - begin) * 1e9 / passes / len(frames)


def poses(name: str, size: int) -> Iterator[str]:
    for frame in prepared[size]:
        result = METHODS[name](frame)
        if result is None:
            yield "none"
            continue
        if name.endswith("poselib"):
            rotation, translation = result.R, result.t
        else:
            rotation, translation = cv2.Rodrigues(result[0])[0], result[1]
        numbers = np.concatenate([np.ravel(rotation), np.ravel(translation)])
        yield " ".join(repr(float(number)) for number in numbers)


for line in sys.stdin:
    match line.split():
        case ["methods"]:
            print(*METHODS)
        case ["time", name, size]:
            print(ns_per_solve(METHODS[name], prepared[int(size)]))
        case ["poses", name, size]:
            for row in poses(name, int(size)):
                print(row)
        case _:
            sys.exit(f"what does {line!r} mean?")
    sys.stdout.flush()
