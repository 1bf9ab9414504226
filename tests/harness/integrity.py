"""Protection levels from dense matrices, written apart from the node's: numpy and scipy, no elimination, no updates.

Σ is formed as a whole, each fault is a column of the fit, and the fit is made anew for every hypothesis.
"""

from dataclasses import dataclass, field
from itertools import combinations
from math import comb

import numpy as np
from scipy.optimize import brentq
from scipy.special import erfc
from scipy.stats import norm

from harness import paper
from harness.camera_model import Camera
from harness.rotations import Array, Pose, skew

# Points that must remain without the suspects.
LEAST_REMAINING = 4
# Thickness over length.
FLAT = 0.02
# Of the risk, kept for frames in which points were left out.
SHARE_OF_EXCLUSIONS = 0.1


@dataclass(frozen=True)
class Probabilities:
    """As the node's parameters have them."""

    hmi: float = 1e-7
    false_alert: float = 1e-5
    fault: float = 1e-4
    flex_fault: float = 0.0


@dataclass(frozen=True)
class Budget:
    """Standard deviations of a marker's place, of shapes in which the airframe bends, and of the focal length."""

    survey_m: float = 0.0
    flex: list[dict[int, Array]] = field(default_factory=list)
    focal_length: float = 0.0


@dataclass(frozen=True)
class Levels:
    """Ahead, lateral, vertical in the receiver, m; or the state that there is instead."""

    state: str
    level: Array | None = None
    sigma: Array | None = None
    unmonitored: float = 0.0


def is_flat(points: list[Array]) -> bool:
    """Whether points lie near one plane."""
    spread = np.linalg.svd(np.array(points) - np.mean(points, axis=0), compute_uv=False)
    return bool(spread[2] <= FLAT * spread[0])


def levels(
    pose: Pose,
    markers: dict[int, tuple[float, float, float]],
    pixels: dict[int, Array],
    sigmas_px: dict[int, float],
    point: Array,
    ambiguity: float,
    probabilities: Probabilities,
    budget: Budget = Budget(),
    camera: Camera = paper.CAMERA,
    max_outliers: int = 1,
    without_second_pose: set[int] | None = None,
) -> Levels:
    """The levels of a point of the tanker for a pose that all these points were fitted by.

    `without_second_pose`: the markers without which the others still fix one pose; all unless given.
    """
    ids = list(markers)
    rows = 2 * len(ids)
    jacobian = np.zeros((rows, 6))
    residuals = np.zeros(rows)
    covariance = np.zeros((rows, rows))
    modes = np.zeros((rows, len(budget.flex) + 1))
    for at, marker in enumerate(ids):
        arm = pose.rotation @ np.array(markers[marker])
        x, y, z = arm + pose.translation
        by_point = np.array(
            [[camera.fx / z, 0.0, -camera.fx * x / z**2], [0.0, camera.fy / z, -camera.fy * y / z**2]]
        )
        here = slice(2 * at, 2 * at + 2)
        jacobian[here] = by_point @ np.hstack([np.eye(3), -skew(arm)])
        predicted = np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])
        residuals[here] = predicted - pixels[marker]
        covariance[here, here] = (
            sigmas_px[marker] ** 2 * np.eye(2) + budget.survey_m**2 * by_point @ by_point.T
        )
        for mode, shape in enumerate(budget.flex):
            modes[here, mode] = by_point @ pose.rotation @ shape.get(marker, np.zeros(3))
        # Where the point was seen.
        modes[here, -1] = budget.focal_length * (pixels[marker] - [camera.cx, camera.cy])
    weights = np.linalg.inv(covariance + modes @ modes.T)

    receiver_from_camera = paper.CAMERA_FROM_RECEIVER.T
    axes = receiver_from_camera @ np.hstack([np.eye(3), -skew(pose.rotation @ point)])

    def fit(columns: Array) -> tuple[Array, Array]:
        """The step of the pose beside free amplitudes of these columns, and its covariance."""
        whole = np.hstack([jacobian, columns])
        inverse = np.linalg.inv(whole.T @ weights @ whole)
        return (-inverse @ whole.T @ weights @ residuals)[:6], inverse[:6, :6]

    step, of_all = fit(np.zeros((rows, 0)))
    sigma = np.sqrt(np.diag(axes @ of_all @ axes.T))
    n, p = len(ids), probabilities.fault
    beyond = sum(comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(3, n + 1))
    hypotheses: list[tuple[float, Array]] = []
    unmonitorable = 0.0
    for size, prior in ((1, p), (2, p * p)):
        for suspects in combinations(range(n), size):
            others = [np.array(markers[i]) for at, i in enumerate(ids) if at not in suspects]
            is_unclear = (
                size == 1
                and without_second_pose is not None
                and ids[suspects[0]] not in without_second_pose
            )
            if n - size < LEAST_REMAINING or is_unclear or (size == 2 and is_flat(others)):
                unmonitorable += prior
                continue
            chosen = [row for at in suspects for row in (2 * at, 2 * at + 1)]
            hypotheses.append((prior, np.eye(rows)[:, chosen]))
    count = n + n * (n - 1) // 2
    if probabilities.flex_fault > 0.0:
        flex = len(budget.flex)
        count += flex
        beyond += flex * probabilities.flex_fault * n * p + 0.5 * (flex * probabilities.flex_fault) ** 2
        hypotheses += [(probabilities.flex_fault, modes[:, [mode]]) for mode in range(flex)]

    quantile = norm.isf(probabilities.false_alert / (2 * count * 3))
    terms: list[list[tuple[float, float, float]]] = [[] for _ in range(3)]
    is_faulty = False
    for prior, columns in hypotheses:
        of_others, variance = fit(columns)
        separation = np.abs(axes @ (of_others - step))
        own = np.sqrt(np.maximum(np.diag(axes @ (variance - of_all) @ axes.T), 0.0))
        is_faulty |= bool((separation > quantile * own).any())
        for axis in range(3):
            terms[axis].append((prior, quantile * own[axis], np.hypot(sigma[axis], own[axis])))
    if is_faulty:
        return Levels("fault")
    allowed = probabilities.hmi * ((1.0 - SHARE_OF_EXCLUSIONS) if max_outliers > 0 else 1.0)
    unmonitored = beyond + unmonitorable + ambiguity
    risk = (allowed - unmonitored) / 3
    if risk <= 0.0:
        return Levels("unmonitored")

    def level(axis: int) -> float:
        prior, threshold, own = np.array([(2.0, 0.0, sigma[axis]), *terms[axis]]).T

        def excess(at: float) -> float:
            tails = 0.5 * erfc((at - threshold) / (own * np.sqrt(2.0)))
            return float(np.log(prior @ tails / risk))

        # Far enough for a risk of 1e-20, near enough that no tail is zero.
        top = float(np.max(threshold + 10.0 * own))
        return float(brentq(excess, 0.0, top, xtol=1e-14, rtol=1e-14))

    found = np.array([level(axis) for axis in range(3)])
    return Levels("available", found, sigma, unmonitored)
