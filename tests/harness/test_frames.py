"""`examples/convert_frames` against SciPy's `Rotation`: means exactly, covariances by sampling.

SciPy shares neither code nor conventions with ours: it multiplies rotations, and each truth is sampled
and converted by plain rigid geometry.
"""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from harness.processes import answers, example
from harness.rotations import Array

SAMPLES = 20_000
# Standard errors of the sampled covariance, and what the second order leaves of a standard deviation.
LIMIT = 5.0
SECOND_ORDER = 0.01

Rigid = tuple[Rotation, Array]

# What the axes mean, written as the images of the unit vectors.
FLU_FROM_OPTICAL = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
FRD_FROM_FLU = Rotation.from_euler("x", 180, degrees=True)
NED_FROM_ENU = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
ATTITUDE = Rotation.from_euler("ZYX", [75, 8, -20], degrees=True)
ATTITUDE_COVARIANCE = np.diag([4e-6, 9e-6, 2.5e-5])
POINT = np.array([2.0, -1.0, 3.0])


def turned(by: Rotation) -> Callable[[Rigid], Rigid]:
    return lambda pose: (by * pose[0], by.apply(pose[1]))


STEPS: dict[str, tuple[Any, Callable[[Rigid], Rigid]]] = {
    "flu_from_optical": (None, turned(FLU_FROM_OPTICAL)),
    "frd_from_flu": (None, turned(FRD_FROM_FLU)),
    "ned_from_enu": (None, turned(NED_FROM_ENU)),
    "target_frd_from_flu": (None, lambda p: (p[0] * FRD_FROM_FLU.inv(), p[1])),
    "inverse": (None, lambda p: (p[0].inv(), -p[0].inv().apply(p[1]))),
    "seen_from_point": (POINT.tolist(), lambda p: (p[0], p[1] - POINT)),
    "of_point": (POINT.tolist(), lambda p: (p[0], p[1] + p[0].apply(POINT))),
    "local_axes": (
        {
            "orientation": ATTITUDE.as_quat().tolist(),
            "covariance": ATTITUDE_COVARIANCE.ravel().tolist(),
        },
        turned(ATTITUDE),
    ),
}

# What bridges do: PX4's relative pose, the receiver in the tanker, drogue from probe.
CHAINS = [
    *([name] for name in STEPS),
    ["flu_from_optical", "frd_from_flu", "local_axes", "target_frd_from_flu"],
    ["flu_from_optical", "local_axes", "ned_from_enu"],
    ["flu_from_optical", "seen_from_point", "of_point", "inverse"],
]


def convert(*requests: dict[str, Any]) -> list[dict[str, Any]]:
    return answers([example("convert_frames")], map(json.dumps, requests))


def request(pose: Rigid, covariance: Array, chain: list[str]) -> dict[str, Any]:
    return {
        "position": pose[1].tolist(),
        "orientation": pose[0].as_quat().tolist(),
        "covariance": covariance.ravel().tolist(),
        "steps": [{name: STEPS[name][0]} for name in chain],
    }


def by_scipy(pose: Rigid, chain: list[str], attitude_error: Rotation | None = None) -> Rigid:
    for name in chain:
        pose = STEPS[name][1](pose)
        if name == "local_axes" and attitude_error is not None:
            pose = turned(attitude_error)(pose)
    return pose


def random_pose(rng: np.random.Generator) -> tuple[Rigid, Array]:
    half = rng.uniform(-2e-3, 2e-3, (6, 6))
    pose = (Rotation.random(rng=rng), rng.uniform(-20.0, 20.0, 3))
    return pose, half @ half.T + 1e-6 * np.eye(6)


@pytest.mark.parametrize("chain", CHAINS, ids="-".join)
def test_means_are_those_of_scipy(chain: list[str], rng: np.random.Generator) -> None:
    poses = [random_pose(rng) for _ in range(50)]

    answers = convert(*(request(pose, covariance, chain) for pose, covariance in poses))

    for (pose, _), answer in zip(poses, answers, strict=True):
        rotation, position = by_scipy(pose, chain)
        found = Rotation.from_quat(answer["orientation"])
        assert np.abs(found.as_matrix() - rotation.as_matrix()).max() < 1e-13
        assert np.abs(np.array(answer["position"]) - position).max() < 1e-12


@pytest.mark.parametrize("chain", CHAINS, ids="-".join)
def test_covariances_are_those_of_samples(chain: list[str], rng: np.random.Generator) -> None:
    pose, covariance = random_pose(rng)

    (answer,) = convert(request(pose, covariance, chain))

    # All truths that the pose and its covariance stand for, converted at once.
    errors = rng.multivariate_normal(np.zeros(6), covariance, SAMPLES)
    truths = (Rotation.from_rotvec(errors[:, 3:]) * pose[0], pose[1] + errors[:, :3])
    attitude_errors = rng.multivariate_normal(np.zeros(3), ATTITUDE_COVARIANCE, SAMPLES)
    rotation, position = by_scipy(truths, chain, Rotation.from_rotvec(attitude_errors))
    found = Rotation.from_quat(answer["orientation"])
    differences = np.hstack(
        [position - np.array(answer["position"]), (rotation * found.inv()).as_rotvec()]
    )
    sampled = differences.T @ differences / SAMPLES
    claimed = np.array(answer["covariance"]).reshape(6, 6)
    assert np.array_equal(claimed, claimed.T)
    sigmas = np.outer(np.sqrt(np.diag(claimed)), np.sqrt(np.diag(claimed)))
    standard_error = np.sqrt((sigmas**2 + claimed**2) / SAMPLES)
    excess = np.abs(sampled - claimed) - LIMIT * standard_error - SECOND_ORDER * sigmas
    assert excess.max() < 0, excess


def test_a_line_that_cannot_be_read_is_answered() -> None:
    answers = convert({"position": [1, 2]}, request(*random_pose(np.random.default_rng(1)), []))

    assert "error" in answers[0]
    assert "position" in answers[1]
