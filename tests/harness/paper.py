"""The set-up of the paper's experiments: markers, camera, frames and poses."""

import numpy as np

from harness.camera_model import Camera
from harness.rotations import Array, Pose, about_x, about_y, about_z

# Table 1, tanker frame (x forward, y left, z up), metres.
MARKERS: dict[int, tuple[float, float, float]] = {
    1: (3.7, -7.13, 0.7),
    2: (3.7, 7.13, 0.7),
    3: (7.79, -2.689, 0.7),
    4: (7.79, 2.689, 0.7),
    5: (7.96, 0.0, 3.189),
    6: (0.0, 0.0, 0.0),
}

CAMERA = Camera(fx=571.0, fy=571.0, cx=254.0, cy=206.0, width=508, height=412)

# Optical axes (x right, y down, z ahead) of a camera that looks along the receiver's x axis.
CAMERA_FROM_RECEIVER: Array = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def camera_from_tanker(
    roll_deg: float,
    pitch_deg: float,
    yaw_deg: float,
    tanker_in_receiver: tuple[float, float, float],
) -> Pose:
    """The pose for R = Rz(yaw) Ry(pitch) Rx(roll) and a position in the receiver, metres."""
    roll, pitch, yaw = np.radians([roll_deg, pitch_deg, yaw_deg])
    receiver_from_tanker = about_z(yaw) @ about_y(pitch) @ about_x(roll)
    return Pose(
        rotation=CAMERA_FROM_RECEIVER @ receiver_from_tanker,
        translation=CAMERA_FROM_RECEIVER @ np.array(tanker_in_receiver, dtype=float),
    )


# Section 4.1.
POSE: Pose = camera_from_tanker(3.0, 2.0, 3.0, (15.0, 0.0, 4.5))


def seeded_pose(rng: np.random.Generator) -> Pose:
    """A pose near refuelling distance, angles within 5°, with all markers well inside the image."""
    while True:
        angles = rng.uniform(-5.0, 5.0, size=3)
        x, y, z = np.array([15.0, 0.0, 4.5]) + rng.uniform(-0.5, 0.5, size=3)
        pose = camera_from_tanker(*angles, (x, y, z))
        # 3 px: noise of 0.5 px must not carry a detection out of the image.
        if CAMERA.sees(marker_pixels(pose), margin_px=3.0):
            return pose


def marker_pixels(
    pose: Pose,
    camera: Camera = CAMERA,
    markers: dict[int, tuple[float, float, float]] = MARKERS,
) -> Array:
    """The exact pixel of every marker, one row each, in the order of `markers`."""
    return camera.project(pose.transform(np.array(list(markers.values()))))
