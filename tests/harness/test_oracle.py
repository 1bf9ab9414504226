"""`tanker_pose solve` against the solvers of others on the same distorted frames.

OpenCV weighs all points alike and has no fisheye in `solvePnP`; SciPy, on the camera models of
`camera_model.py`, has both. Their limits are so tight that what remains is our own: the refinement
stops when a step promises to lower chi-squared by less than 1e-6, a thousandth of a sigma.
"""

import json
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares

from harness import paper
from harness.camera_model import LENSES, Camera
from harness.consistency import cramer_rao_covariance, pose_error
from harness.rotations import Array, Pose, exp
from harness.solver import pose_in, request, solve

FRAMES = 200
SIGMA_PX = 0.5

# Standard deviations, by the covariance of the answer. What the stopping rule allows.
SAME_POSE_SIGMAS = 1e-3
# rad and m, at 12 m to 40 m and half a pixel; a standard deviation is about 2e-3 rad and 0.1 m.
SAME_ROTATION = 1e-6
SAME_TRANSLATION_M = 1e-5
# Of each standard deviation: the covariance is taken one step before the last.
SAME_COVARIANCE = 1e-3

# Every frame has its pose, however unlikely its noise, and no point is left out.
ALL_POINTS = (
    *("--max-outliers", "0", "--trust-probability", "0.999999"),
    *("--min-points", "3", "--max-ambiguity", "1"),
)


def distorted(model: str) -> Camera:
    return replace(paper.CAMERA, model=model, d=LENSES[model])


def noisy_frames(
    rng: np.random.Generator, camera: Camera, sigmas_px: float | Array
) -> list[tuple[Pose, Array]]:
    """Poses of the refuelling envelope, 12 m to 40 m and ±5°, and the pixels seen."""
    frames: list[tuple[Pose, Array]] = []
    while len(frames) < FRAMES:
        range_m = rng.uniform(12.0, 40.0)
        angles = rng.uniform(-5.0, 5.0, size=3)
        truth = paper.camera_from_tanker(*angles, (range_m, 0.0, 0.3 * range_m))
        exact = paper.marker_pixels(truth, camera)
        if camera.sees(exact, margin_px=3.0):
            noise = rng.normal(0.0, np.reshape(sigmas_px, (-1, 1)), exact.shape)
            frames.append((truth, exact + noise))
    return frames


def answers(
    frames: list[tuple[Pose, Array]], camera: Camera, sigmas_px: float | Array
) -> list[dict[str, Any]]:
    lines = (
        json.dumps(request(number, pixels, sigmas_px, camera))
        for number, (_, pixels) in enumerate(frames)
    )
    found = solve(*lines, arguments=ALL_POINTS)
    assert [answer["outcome"] for answer in found] == ["ok"] * len(frames)
    return found


def covariance_of(answer: dict[str, Any]) -> Array:
    return np.array(answer["covariance"]).reshape(6, 6)


def expect_same(poses: list[Pose], found: list[dict[str, Any]], oracle: str) -> None:
    """Every pose agrees with the oracle's; prints by how much they differ at most."""
    errors = np.array([pose_error(p, pose_in(a)) for p, a in zip(poses, found, strict=True)])
    sigmas = np.sqrt(
        [e @ np.linalg.solve(covariance_of(a), e) for e, a in zip(errors, found, strict=True)]
    )
    translation = np.linalg.norm(errors[:, :3], axis=1).max()
    rotation = np.linalg.norm(errors[:, 3:], axis=1).max()
    print(
        f"{oracle}, {len(poses)} frames: at most {rotation:.1e} rad, {translation:.1e} m, "
        f"{sigmas.max():.1e} sigma"
    )
    assert sigmas.max() < SAME_POSE_SIGMAS
    assert rotation < SAME_ROTATION
    assert translation < SAME_TRANSLATION_M


def opencv_pose(camera: Camera, pixels: Array) -> Pose:
    """The least squared pixel residuals, by OpenCV: SQPnP, then Levenberg-Marquardt."""
    points = np.array(list(paper.MARKERS.values()))
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    d = np.array(camera.d)
    found, rotation, translation = cv2.solvePnP(points, pixels, matrix, d, flags=cv2.SOLVEPNP_SQPNP)
    assert found
    never_satisfied = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-16)
    rotation, translation = cv2.solvePnPRefineLM(
        points, pixels, matrix, d, rotation, translation, never_satisfied
    )
    return Pose(cv2.Rodrigues(rotation)[0], translation.ravel())


def scipy_pose(camera: Camera, pixels: Array, sigmas_px: Array, start: Pose) -> Pose:
    """The least squared residuals over their variances, by SciPy."""
    weights = 1 / np.reshape(sigmas_px, (-1, 1))

    def at(step: Array) -> Pose:
        return Pose(exp(step[3:]) @ start.rotation, start.translation + step[:3])

    def residuals(step: Array) -> Array:
        return ((paper.marker_pixels(at(step), camera) - pixels) * weights).ravel()

    fit = least_squares(
        residuals, np.zeros(6), jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac"
    )
    return at(fit.x)


@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_opencv_finds_the_same_poses(rng: np.random.Generator, model: str) -> None:
    camera = distorted(model)
    frames = noisy_frames(rng, camera, SIGMA_PX)

    found = answers(frames, camera, SIGMA_PX)

    expect_same([opencv_pose(camera, pixels) for _, pixels in frames], found, f"OpenCV, {model}")


@pytest.mark.parametrize("model", LENSES)
def test_scipy_finds_the_same_poses_and_covariances(rng: np.random.Generator, model: str) -> None:
    camera = distorted(model)
    sigmas_px = np.array([0.2, 0.3, 0.5, 0.5, 0.8, 1.0])
    frames = noisy_frames(rng, camera, sigmas_px)

    found = answers(frames, camera, sigmas_px)

    poses = [scipy_pose(camera, pixels, sigmas_px, truth) for truth, pixels in frames]
    expect_same(poses, found, f"SciPy, {model}")
    worst = 0.0
    for pose, answer in zip(poses, found, strict=True):
        expected = cramer_rao_covariance(pose, paper.MARKERS, camera, sigmas_px)
        ratios = np.diag(covariance_of(answer)) / np.diag(expected)
        worst = max(worst, float(np.abs(np.sqrt(ratios) - 1).max()))
    print(f"SciPy, {model}: standard deviations differ by at most {worst:.1e} of themselves")
    assert worst < SAME_COVARIANCE
