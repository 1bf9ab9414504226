"""Is a covariance honest? Errors in the ROS parameterisation, and what chi-square allows."""

import numpy as np
from scipy.stats import chi2

from harness.camera_model import Camera
from harness.paper import marker_pixels
from harness.rotations import Array, Pose, exp, log


def pose_error(truth: Pose, found: Pose) -> Array:
    """(x, y, z, rotX, rotY, rotZ) about the camera frame's fixed axes, as the covariance means it.

    t_true = t_found + δt and R_true = Exp(δθ) R_found.
    """
    return np.concatenate(
        [
            truth.translation - found.translation,
            log(truth.rotation @ found.rotation.T),
        ]
    )


def nees(truth: Pose, found: Pose, covariance: Array) -> float:
    """Normalised estimation error squared: chi-squared with six degrees of freedom when honest."""
    error = pose_error(truth, found)
    return float(error @ np.linalg.solve(covariance, error))


def mean_nees_bounds(samples: int, confidence: float = 0.999) -> tuple[float, float]:
    """Between these the mean of `samples` honest NEES values lies with the given probability."""
    tail = (1 - confidence) / 2
    low, high = chi2.ppf([tail, 1 - tail], df=6 * samples) / samples
    return float(low), float(high)


def cramer_rao_covariance(
    pose: Pose, markers: dict[int, tuple[float, float, float]], camera: Camera, sigmas_px: Array
) -> Array:
    """The least covariance that any unbiased estimate can have at `pose`, ROS order.

    Derivatives by central differences: slow, but no formula to get wrong.
    """
    step = 1e-5
    columns = []
    for axis in range(6):
        delta = np.zeros(6)
        delta[axis] = step
        ahead, back = (
            marker_pixels(moved(pose, sign * delta), camera, markers).ravel() for sign in (1, -1)
        )
        columns.append((ahead - back) / (2 * step))
    jacobian = np.stack(columns, axis=1) / np.repeat(sigmas_px, 2)[:, None]
    return np.linalg.inv(jacobian.T @ jacobian)


def moved(pose: Pose, delta: Array) -> Pose:
    """`pose` with an error (x, y, z, rotX, rotY, rotZ) applied."""
    return Pose(rotation=exp(delta[3:]) @ pose.rotation, translation=pose.translation + delta[:3])
