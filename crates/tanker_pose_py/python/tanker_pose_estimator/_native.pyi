"""Types of the compiled module; the public names are those of the package."""

import os
from collections.abc import Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

class RefusalError(ValueError):
    """A frame has no trusted pose. `frame` holds its outcome and numbers, the message says why."""

    frame: Frame

@final
class Camera:
    """A checked camera."""

    def __new__(
        cls, fx: float, fy: float, cx: float, cy: float, *, width: int = 0, height: int = 0
    ) -> Camera: ...
    @staticmethod
    def from_file(path: str | os.PathLike[str], *, rectified: bool = False) -> Camera: ...
    @staticmethod
    def from_dict(fields: dict[str, Any], *, rectified: bool = False) -> Camera: ...
    @property
    def image_size(self) -> tuple[int, int] | None: ...
    @property
    def rectified(self) -> bool: ...

@final
class MarkerMap:
    """A checked marker map."""

    @staticmethod
    def shipped(name: str) -> MarkerMap: ...
    @staticmethod
    def from_file(path: str | os.PathLike[str]) -> MarkerMap: ...
    @staticmethod
    def from_dict(fields: dict[str, Any]) -> MarkerMap: ...
    @property
    def name(self) -> str: ...
    @property
    def ids(self) -> list[int]: ...
    @property
    def points(self) -> npt.NDArray[np.float64]: ...
    def __len__(self) -> int: ...

@final
class Budget:
    """What a calibration may have wrong: standard deviations, or a covariance."""

    @staticmethod
    def from_file(path: str | os.PathLike[str]) -> Budget: ...
    @staticmethod
    def from_dict(fields: dict[str, Any]) -> Budget: ...

@final
class Frame:
    """The outcome of one frame: a trusted pose, or the reason why there is none."""

    @property
    def outcome(self) -> int: ...
    @property
    def message(self) -> str: ...
    @property
    def is_trusted(self) -> bool: ...
    @property
    def rotation(self) -> npt.NDArray[np.float64]: ...
    @property
    def translation(self) -> npt.NDArray[np.float64]: ...
    @property
    def covariance(self) -> npt.NDArray[np.float64]: ...
    @property
    def rms_px(self) -> float | None: ...
    @property
    def chi_squared(self) -> float | None: ...
    @property
    def chi_squared_limit(self) -> float | None: ...
    @property
    def ambiguity(self) -> float | None: ...
    @property
    def degrees_of_freedom(self) -> int | None: ...
    @property
    def iterations(self) -> int | None: ...
    @property
    def certificate(self) -> str | None: ...
    @property
    def used_ids(self) -> list[int]: ...
    @property
    def rejected_ids(self) -> list[int]: ...
    @property
    def track(self) -> int: ...
    @property
    def motion(self) -> Motion | None: ...
    @property
    def modes(self) -> dict[str, float]: ...
    @property
    def dominant_cause(self) -> str | None: ...

@final
class Motion:
    """The motion of the tanker in the camera at a frame's stamp, filtered over the frames before it."""

    @property
    def rotation(self) -> npt.NDArray[np.float64]: ...
    @property
    def translation(self) -> npt.NDArray[np.float64]: ...
    @property
    def velocity(self) -> npt.NDArray[np.float64]: ...
    @property
    def rate(self) -> npt.NDArray[np.float64]: ...
    @property
    def covariance(self) -> npt.NDArray[np.float64]: ...

@final
class Estimator:
    """The estimator for frames of one camera and one set of markers."""

    def __new__(
        cls,
        camera: Camera,
        markers: MarkerMap | npt.ArrayLike,
        *,
        ids: Sequence[int] | None = None,
        budget: Budget | None = None,
        **parameters: bool | float | str,
    ) -> Estimator: ...
    def estimate(
        self,
        pixels: npt.ArrayLike,
        sigma_px: npt.ArrayLike | None = None,
        *,
        ids: Sequence[int] | None = None,
        previous: npt.ArrayLike | None = None,
    ) -> Frame: ...
    def estimate_many(
        self,
        pixels: npt.ArrayLike,
        sigma_px: npt.ArrayLike | None = None,
        *,
        visible: npt.ArrayLike | None = None,
    ) -> npt.NDArray[np.void]: ...

@final
class Pipeline:
    """The estimator with what it remembers between frames: the last attitude, the track, suspect markers."""

    def __new__(
        cls,
        camera: Camera,
        marker_map: MarkerMap,
        *,
        frame_id: str = "camera",
        budget: Budget | None = None,
        **parameters: bool | float | str,
    ) -> Pipeline: ...
    def set_camera(self, camera: Camera) -> bool: ...
    def process(
        self,
        stamp_ns: int,
        pixels: npt.ArrayLike,
        sigma_px: npt.ArrayLike | None = None,
        *,
        ids: Sequence[int] | None = None,
        frame_id: str | None = None,
        receiver_from_tanker: npt.ArrayLike | None = None,
    ) -> Frame: ...
    def reset(self) -> None: ...

def codes() -> tuple[list[tuple[str, int]], list[tuple[str, int]]]: ...
def replay(
    recording: str | os.PathLike[str],
    output: str | os.PathLike[str],
    ros_arguments: Sequence[str],
    answers_only: bool,
) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]: ...
def run_tool(arguments: Sequence[str]) -> int: ...
