"""Reads the frames that the Rust worker writes; the layout is told there."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    truth_rotation: Array
    truth_translation: Array
    prior_rotation: Array
    prior_translation: Array
    markers: Array
    pixels: Array


def read(path: Path) -> tuple[tuple[float, ...], list[list[Frame]]]:
    """(fx, fy, cx, cy), and the frames of each size."""
    values = np.fromfile(path, dtype="<f8")
    at = 0

    def take(count: int) -> Array:
        nonlocal at
        at += count
        return values[at - count : at]

    camera = tuple(float(value) for value in take(4))
    sizes = []
    for _ in range(int(take(1)[0])):
        points, count = (int(value) for value in take(2))
        frames = []
        for _ in range(count):
            truth, prior = take(12), take(12)
            rows = take(7 * points).reshape(points, 7)
            frames.append(
                Frame(
                    truth[:9].reshape(3, 3),
                    truth[9:],
                    prior[:9].reshape(3, 3),
                    prior[9:],
                    rows[:, :3],
                    rows[:, 3:5],
                )
            )
        sizes.append(frames)
    return camera, sizes
