"""`tanker_pose solve` as a function: frames in, answers out, through the real program's pipes."""

from typing import Any

import numpy as np

from harness import paper
from harness.camera_model import Camera
from harness.processes import answers, binary
from harness.rotations import Array, Pose


def request(
    number: int, pixels: Array, sigma: float | Array = 0.5, camera: Camera = paper.CAMERA
) -> dict[str, Any]:
    """A frame of the paper's markers, as a line of input holds it."""
    sigmas = np.broadcast_to(sigma, len(paper.MARKERS))
    return {
        "id": number,
        "camera": {
            "width": camera.width,
            "height": camera.height,
            "distortion_model": camera.model,
            "d": list(camera.d),
            "k": [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1],
        },
        "points": [
            {"id": marker, "x": x, "y": y, "z": z, "u": float(u), "v": float(v), "sigma": float(s)}
            for (marker, (x, y, z)), (u, v), s in zip(
                paper.MARKERS.items(), pixels, sigmas, strict=True
            )
        ],
    }


def solve(*lines: str, arguments: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """The answers to the given input lines."""
    return answers([binary("tanker_pose"), "solve", *arguments], lines)


def pose_in(answer: dict[str, Any]) -> Pose:
    """The pose of an answer that has one."""
    return Pose(np.array(answer["rotation"]).reshape(3, 3), np.array(answer["translation"]))
