"""The tanker's pose from pixels of its beacons, with an honest covariance.

Frames: ``tanker`` has x forward, y left, z up; ``camera`` is the optical frame, x right, y down, z ahead. A pose is
``camera_from_tanker``: ``point_in_camera = rotation @ point_in_tanker + translation``. Metres, radians, pixels; the
centre of the top-left pixel is (0, 0).
"""

import enum

from ._native import Camera, Estimator, Frame, MarkerMap, RefusalError

__all__ = ["Camera", "Estimator", "Frame", "MarkerMap", "Outcome", "RefusalError"]


class Outcome(enum.IntEnum):
    """The outcome of a frame: the numbers of ``tanker_pose/msg/EstimatorStatus``."""

    OK = 0
    NO_CAMERA_INFO = 1
    INVALID_CAMERA_INFO = 2
    FRAME_MISMATCH = 3
    ZERO_STAMP = 4
    UNKNOWN_ID = 5
    DUPLICATE_ID = 6
    NOT_FINITE = 7
    INVALID_SIGMA = 8
    OUTSIDE_IMAGE = 9
    TOO_FEW_POINTS = 10
    DEGENERATE_GEOMETRY = 11
    NO_CONVERGENCE = 12
    BEHIND_CAMERA = 13
    NOT_TRUSTED = 14
    AMBIGUOUS = 15
