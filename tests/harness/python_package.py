"""The built Python package, as `tests/python_package` unpacks it, and inputs of frames for it."""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from harness import paper
from harness.processes import REPOSITORY
from harness.rotations import Array
from harness.solver import request

IDS = list(paper.MARKERS)
POINTS: Array = np.array(list(paper.MARKERS.values()))


def directory() -> Path:
    """Where the package is unpacked."""
    default = REPOSITORY / "target" / "python"
    path = Path(os.environ.get("TANKER_POSE_PYTHON_DIR", default)).resolve()
    assert (path / "tanker_pose_estimator").is_dir(), f"no package in {path}: run tests/python_package first"
    return path


if str(directory()) not in sys.path:
    sys.path.append(str(directory()))

import tanker_pose_estimator as tpe  # noqa: E402


def camera(**changes: Any) -> tpe.Camera:
    """The camera of the paper's experiments."""
    return tpe.Camera.from_dict(json.loads(json.dumps(request(0, np.zeros((6, 2)))["camera"])) | changes)


def frames(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Pixels (F, 6, 2) and sigmas (F, 6) of frames; every seventh has a detection that is wrong by 30 px."""
    sigmas = rng.uniform(0.2, 0.8, size=(count, 6))
    pixels = np.array([paper.marker_pixels(paper.seeded_pose(rng)) for _ in range(count)])
    pixels = pixels + sigmas[:, :, None] * rng.normal(size=pixels.shape)
    pixels[::7, 2, 1] += 30.0
    return pixels, sigmas
