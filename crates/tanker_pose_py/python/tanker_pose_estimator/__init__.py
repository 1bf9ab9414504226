"""The tanker's pose from pixels of its beacons, with an honest covariance.

Frames: ``tanker`` has x forward, y left, z up; ``camera`` is the optical frame, x right, y down, z ahead. A pose is
``camera_from_tanker``: ``point_in_camera = rotation @ point_in_tanker + translation``. Metres, radians, pixels; the
centre of the top-left pixel is (0, 0). F is a number of frames, N a number of points.

What cannot be used raises ``ValueError``; a frame without a trusted pose raises its subclass ``RefusalError`` from
``estimate``, and is an outcome with its reason everywhere else.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._native import (
    Budget,
    Camera,
    Estimator,
    Frame,
    MarkerMap,
    Motion,
    Pipeline,
    RefusalError,
)
from ._native import replay as _replay

if TYPE_CHECKING:
    import pandas

__all__ = [
    "Budget",
    "Camera",
    "Estimator",
    "Frame",
    "MarkerMap",
    "Motion",
    "Outcome",
    "Pipeline",
    "RefusalError",
    "Replayed",
    "Track",
    "estimate",
    "estimate_many",
    "replay",
]


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


class Track(enum.IntEnum):
    """The effect of a frame on the track: the constants ``TRACK_...`` of the same message."""

    NONE = 0
    CANDIDATE = 1
    UPDATED = 2
    PREDICTED = 3
    GATED = 4
    OUT_OF_ORDER = 5
    INSERTED = 6


_MOST_KEPT = 16
_kept: dict[Any, Estimator] = {}


def _numbers(values: npt.ArrayLike | None) -> Any:
    """Returns what tells these numbers from others."""
    if values is None:
        return None
    array = np.asarray(values)
    return array.dtype.str, array.shape, array.tobytes()


def _estimator(
    camera: Camera,
    markers: MarkerMap | npt.ArrayLike,
    ids: Sequence[int] | None,
    budget: Budget | None,
    parameters: dict[str, bool | float | str],
) -> Estimator:
    """Returns an estimator; the last ones are kept, because making one takes as long as hundreds of frames."""
    of_markers = markers if isinstance(markers, MarkerMap) else _numbers(markers)
    # The type belongs to a value: True, 1 and 1.0 are equal, and only one of them is right.
    of_parameters = tuple((name, type(value), value) for name, value in parameters.items())
    key = (camera, of_markers, _numbers(ids), budget, of_parameters)
    found = _kept.get(key)
    if found is None:
        found = Estimator(camera, markers, ids=ids, budget=budget, **parameters)
        while len(_kept) >= _MOST_KEPT:
            _kept.pop(next(iter(_kept)), None)
        _kept[key] = found
    return found


def estimate(
    camera: Camera,
    markers: MarkerMap | npt.ArrayLike,
    pixels: npt.ArrayLike,
    sigma_px: npt.ArrayLike | None = None,
    *,
    ids: Sequence[int] | None = None,
    budget: Budget | None = None,
    previous: npt.ArrayLike | None = None,
    **parameters: bool | float | str,
) -> Frame:
    """Returns the pose of one frame; ``RefusalError`` without a trusted one.

    markers: a ``MarkerMap``, or points (N, 3) on the tanker, m. pixels: (N, 2), in the order of ids. sigma_px: standard
    deviation of column and row, a number or (N,), px; 0 or None: the parameter ``pixel_sigma_px``. The other arguments are
    those of ``Estimator``.
    """
    estimator = _estimator(camera, markers, ids, budget, parameters)
    return estimator.estimate(pixels, sigma_px, previous=previous)


def estimate_many(
    camera: Camera,
    markers: MarkerMap | npt.ArrayLike,
    pixels: npt.ArrayLike,
    sigma_px: npt.ArrayLike | None = None,
    *,
    visible: npt.ArrayLike | None = None,
    ids: Sequence[int] | None = None,
    budget: Budget | None = None,
    **parameters: bool | float | str,
) -> npt.NDArray[np.void]:
    """Returns the outcomes of many frames, each on its own, as ``Estimator.estimate_many`` does."""
    estimator = _estimator(camera, markers, ids, budget, parameters)
    return estimator.estimate_many(pixels, sigma_px, visible=visible)


@dataclasses.dataclass(frozen=True)
class Replayed:
    """The answers to a recording.

    ``topics`` has the columns of each topic by its absolute name. ``/status`` has one row a frame: stamp_ns, outcome, message, track, chi_squared, ...; ``/pose`` one a trusted pose:
    stamp_ns, translation (rows, 3), quaternion_xyzw (rows, 4), covariance (rows, 6, 6); ``/odometry`` the track, besides
    with linear, angular (rows, 3; the tanker's axes) and twist_covariance.
    """

    topics: dict[str, dict[str, Any]]
    frames: int
    messages: int
    outcomes: dict[str, int]
    skipped: list[str]
    """What could not be read or used, in words."""
    notes: list[str]
    """What was used and may surprise."""

    def dataframe(self, topic: str) -> pandas.DataFrame:
        """Returns the columns of a topic for pandas: each element of a vector or matrix has a column of its own.

        ``translation`` becomes ``translation_0`` to ``translation_2``, ``covariance`` ``covariance_0_0`` to
        ``covariance_5_5``. Needs pandas.
        """
        import pandas

        columns: dict[str, Any] = {}
        for name, column in self.topics[topic].items():
            places = np.ndindex(column.shape[1:]) if isinstance(column, np.ndarray) else [()]
            for place in places:
                elements = column[(slice(None), *place)] if place else column
                columns["_".join(map(str, (name, *place)))] = elements
        return pandas.DataFrame(columns)


def replay(
    recording: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, bool | float | str] | None = None,
    ros_arguments: Sequence[str] = (),
) -> Replayed:
    """Answers a recording as the node would: an MCAP file, a .db3 file or the folder of a bag.

    output: MCAP file for the recording and its answers; without it nothing is kept. parameters: those of the node.
    ros_arguments: remaps and files as the node takes them, ``["-r", "/camera_info:=/front/camera_info"]``.
    """
    given = [word for name, value in (parameters or {}).items() for word in ("-p", f"{name}:={json.dumps(value)}")]
    arguments = [*ros_arguments, *given]
    if output is not None:
        topics, read = _replay(recording, output, arguments, False)
        return Replayed(topics, **read)
    with tempfile.TemporaryDirectory(prefix="tanker_pose") as folder:
        topics, read = _replay(recording, Path(folder) / "answers.mcap", arguments, True)
    return Replayed(topics, **read)
