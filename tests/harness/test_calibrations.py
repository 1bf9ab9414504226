"""Sixty calibrations made by OpenCV on simulated boards: each pixel has a ray just where the lens model holds.

The judge is a continuation written apart: from the image's centre outwards along the line to the pixel, the ideal
point is followed by Newton, until the pixel is reached, or until a pole (the denominator of the radial ratio has a
root) or a fold (the derivative is no longer positive definite) lies in the way.
"""

import json
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from harness.processes import answers, example
from harness.rotations import Array

WIDTH, HEIGHT, FOCAL = 1280, 960, 900.0
CALIBRATIONS = 60
BOARDS = 8
# px, of the corners.
NOISE_PX = 0.2
# Stretches of the lens, relative to the centre. The node's limits are 1e-3 at a fold and 10 on the way up to a pole,
# and its valid region is a disc, while a tangential part makes the distance of both depend on the direction. So a pixel
# must have a ray if no stretch on the way to it leaves the first range, and may have one only within the second.
SURE = (0.03, 9.0)
POSSIBLE = (0.5e-3, 20.0)
# As of numpy: threads that spin for work hold up the nodes of other tests.
cv2.setNumThreads(1)
PIXELS = np.stack(
    np.meshgrid(np.linspace(0, WIDTH - 1, 17), np.linspace(0, HEIGHT - 1, 13)), axis=-1
).reshape(-1, 2)


@dataclass(frozen=True)
class Calibration:
    model: str
    d: Array
    k: Array


def board_views(rng: np.random.Generator, camera: Array, d: Array) -> tuple[list, list]:
    """Corners of a chessboard in the world and in noisy images of a lens."""
    columns, rows = np.meshgrid(np.arange(9.0), np.arange(6.0))
    board = np.stack([columns.ravel(), rows.ravel(), np.zeros(54)], axis=1).astype(np.float32)
    board -= board.mean(axis=0)
    world, image = [], []
    while len(image) < BOARDS:
        turn = rng.normal(0.0, 0.35, 3)
        # Off the axis, but never so near the edge that corners leave the image.
        place = np.array([rng.uniform(-5, 5), rng.uniform(-4, 4), rng.uniform(9, 16)])
        corners, _ = cv2.projectPoints(board, turn, place, camera, d)
        corners = corners.reshape(-1, 2) + rng.normal(0.0, NOISE_PX, (54, 2))
        if (corners > 0).all() and (corners < [WIDTH, HEIGHT]).all():
            world.append(board)
            image.append(corners.astype(np.float32))
    return world, image


def calibrate(seed: int) -> Calibration:
    """A calibration as users make it: some with the rational model, some without."""
    rng = np.random.default_rng([7, seed])
    truth = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
    lens = np.array([rng.uniform(-0.35, 0.1), rng.uniform(-0.05, 0.12), *rng.normal(0, 1e-3, 2), 0])
    world, image = board_views(rng, truth, lens)
    rational = seed % 4 != 0
    flags = cv2.CALIB_RATIONAL_MODEL if rational else 0
    _, k, d, _, _ = cv2.calibrateCamera(world, image, (WIDTH, HEIGHT), None, None, flags=flags)
    count = 8 if rational else 5
    return Calibration("rational_polynomial" if rational else "plumb_bob", d.ravel()[:count], k)


def bend(d: Array, points: Array) -> tuple[Array, Array]:
    """Distorted points and their derivatives (xx, xy, yy of a symmetric matrix), written from the formula."""
    k1, k2, p1, p2, k3, k4, k5, k6 = np.concatenate([d, np.zeros(8)])[:8]
    x, y = points.T
    s = x * x + y * y
    down = 1 + s * (k4 + s * (k5 + s * k6))
    ratio = (1 + s * (k1 + s * (k2 + s * k3))) / down
    slope = (k1 + s * (2 * k2 + 3 * s * k3) - ratio * (k4 + s * (2 * k5 + 3 * s * k6))) / down
    image = np.stack(
        [
            ratio * x + 2 * p1 * x * y + p2 * (s + 2 * x * x),
            ratio * y + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )
    xx = ratio + 2 * slope * x * x + 2 * p1 * y + 6 * p2 * x
    yy = ratio + 2 * slope * y * y + 6 * p1 * y + 2 * p2 * x
    xy = 2 * slope * x * y + 2 * p1 * x + 2 * p2 * y
    return image, np.stack([xx, xy, yy])


def reached(calibration: Calibration, *ranges: tuple[float, float]) -> Array:
    """For each range: which pixels a continuation from the centre reaches without a pole, with all stretches in it."""
    d, k = calibration.d, calibration.k
    targets = (PIXELS - k[:2, 2]) / [k[0, 0], k[1, 1]]
    # Roots of the denominator in s, where a pole is.
    k4, k5, k6 = np.concatenate([d, np.zeros(8)])[5:8]
    roots = np.roots([k6, k5, k4, 1.0])
    poles = [root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0]
    pole = min(poles, default=np.inf)
    held = np.ones((len(ranges), len(targets)), dtype=bool)
    alive = np.arange(len(targets))  # those whose continuation has not ended yet
    ideal = np.zeros_like(targets)
    with np.errstate(all="ignore"):
        for part in np.linspace(0, 1, 101)[1:]:
            before, ideal = ideal, follow(d, pole, ideal, part * targets[alive])
            image, derivative = bend(d, ideal)
            good = np.isfinite(derivative).all(axis=0)
            good &= np.linalg.norm(image - part * targets[alive], axis=1) < 1e-9
            good &= (ideal * ideal).sum(axis=1) < pole
            # Farther in one step than any lens in the range goes: over a fold, to its far side.
            good &= np.linalg.norm(ideal - before, axis=1) < 0.3
            low, high = eigenvalues(derivative)
            for number, (least, most) in enumerate(ranges):
                most = np.inf if calibration.model == "plumb_bob" else most
                held[number, alive] &= good & (low > least) & (high < most)
            still = held[:, alive].any(axis=0)
            alive, ideal = alive[still], ideal[still]
    return held


def eigenvalues(symmetric: Array) -> tuple[Array, Array]:
    """The smaller and the larger of each matrix xx, xy, yy."""
    xx, xy, yy = symmetric
    middle, apart = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return middle - apart, middle + apart


def follow(d: Array, pole: float, ideal: Array, target: Array) -> Array:
    """The ideal points of distorted ones that lie near those of the given ideal points, by damped Newton."""
    for _ in range(20):
        image, (xx, xy, yy) = bend(d, ideal)
        left = np.linalg.norm(target - image, axis=1)
        if not (left > 1e-12).any():
            break
        determinant = xx * yy - xy * xy
        singular = ~np.isfinite(determinant) | (np.abs(determinant) < 1e-12)
        u, v = (target - image).T
        step = np.stack([yy * u - xy * v, xx * v - xy * u], axis=1) / determinant[:, None]
        step[singular] = (target - image)[singular]
        # Halved until it comes nearer and stays before the pole: a leap over it is no continuation.
        for _ in range(12):
            there = ideal + step
            rest = np.linalg.norm(target - bend(d, there)[0], axis=1)
            bad = (~(rest <= left) | ((there * there).sum(axis=1) >= pole)) & (left > 1e-12)
            if not bad.any():
                break
            step[bad] *= 0.5
        ideal = ideal + step
    return ideal


def rays(calibration: Calibration) -> tuple[Array, Array]:
    """Whether the program gives each pixel a ray, and how far from the pixel that ray projects."""
    request = {
        "width": WIDTH,
        "height": HEIGHT,
        "model": calibration.model,
        "d": calibration.d.tolist(),
        "k": calibration.k.ravel().tolist(),
        "pixels": PIXELS.tolist(),
    }
    (answer,) = answers([example("pixel_rays")], [json.dumps(request)])
    accepted = np.array([ray is not None for ray in answer["rays"]])
    back = np.array([pixel or [np.nan, np.nan] for pixel in answer["pixels"]])
    return accepted, np.linalg.norm(back - PIXELS, axis=1)


@pytest.fixture(scope="module")
def calibrations() -> list[Calibration]:
    return [calibrate(seed) for seed in range(CALIBRATIONS)]


def test_no_pixel_within_reach_is_refused_and_none_beyond_accepted(
    calibrations: list[Calibration],
) -> None:
    limited = 0
    for number, calibration in enumerate(calibrations):
        accepted, errors = rays(calibration)
        sure, possible = reached(calibration, SURE, POSSIBLE)
        assert not (sure & ~accepted).any(), f"{number}: {PIXELS[sure & ~accepted][:3]} refused"
        assert not (accepted & ~possible).any(), f"{number}: {PIXELS[accepted & ~possible][:3]}"
        assert errors[accepted].max() < 1e-9, number
        limited += not accepted.all()
    # Otherwise nothing would be tested: poles and folds within the image do occur.
    assert 10 < limited < 50
    print(f"{limited} of {CALIBRATIONS} calibrations end inside the image")
