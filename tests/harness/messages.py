"""From the numpy truth to ROS messages and back."""

from collections.abc import Iterable

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header
from tanker_pose.msg import FeaturePoint, FeaturePointArray

from harness import paper
from harness.camera_model import Camera
from harness.rotations import Array, Pose, from_quaternion

CAMERA_FRAME = "refuelling_camera_optical"
SIGMA_PX = 0.5


# 50 Hz, in nanoseconds that a float of seconds cannot hold.
FRAME_PERIOD_NS = 20_000_001
_FIRST_STAMP_NS = 1_700_000_000_987_654_321


def stamp_of(index: int) -> Time:
    """A stamp of its own for every index."""
    sec, nanosec = divmod(_FIRST_STAMP_NS + index * FRAME_PERIOD_NS, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def key(stamp: Time) -> tuple[int, int]:
    """A stamp as something to compare and to look up by."""
    return stamp.sec, stamp.nanosec


def camera_info(camera: Camera = paper.CAMERA, frame_id: str = CAMERA_FRAME) -> CameraInfo:
    """The camera as ROS tells it; P repeats K, as for a camera that needs no rectification."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    return CameraInfo(
        header=Header(stamp=Time(sec=1), frame_id=frame_id),
        width=camera.width,
        height=camera.height,
        distortion_model=camera.model,
        d=list(camera.d),
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def feature_points(
    index: int,
    pixels: Array,
    *,
    ids: Iterable[int] = paper.MARKERS,
    sigmas_px: float | Iterable[float] = SIGMA_PX,
    frame_id: str = CAMERA_FRAME,
) -> FeaturePointArray:
    """One image's detections, stamped with `stamp_of(index)`."""
    # No detector that works sees the same to the last bit in image after image, and none that does is believed.
    pixels = np.asarray(pixels) + 1e-9 * (index % 1000)
    sigmas = np.broadcast_to(np.asarray(sigmas_px, dtype=float), len(pixels))
    return FeaturePointArray(
        header=Header(stamp=stamp_of(index), frame_id=frame_id),
        points=[
            FeaturePoint(id=marker, u=float(u), v=float(v), sigma=float(sigma))
            for marker, (u, v), sigma in zip(ids, pixels, sigmas, strict=True)
        ],
    )


def exact_frame(
    index: int, pose: Pose = paper.POSE, camera: Camera = paper.CAMERA
) -> FeaturePointArray:
    """What a perfect detector would send of the paper's markers."""
    return feature_points(index, paper.marker_pixels(pose, camera))


def noisy_frame(
    index: int,
    pose: Pose,
    rng: np.random.Generator,
    *,
    sigma_px: float = SIGMA_PX,
    camera: Camera = paper.CAMERA,
) -> FeaturePointArray:
    """What an honest detector would send: Gaussian noise of the sigma that it states."""
    pixels = paper.marker_pixels(pose, camera)
    return feature_points(
        index, pixels + rng.normal(0.0, sigma_px, pixels.shape), sigmas_px=sigma_px
    )


def pose_of(message: PoseMessage) -> Pose:
    """The pose that a message carries."""
    p, q = message.position, message.orientation
    return Pose(rotation=from_quaternion(q.x, q.y, q.z, q.w), translation=np.array([p.x, p.y, p.z]))


def covariance_of(message: PoseWithCovarianceStamped) -> Array:
    """The 6×6 covariance of a pose message, ROS order."""
    return np.array(message.pose.covariance).reshape(6, 6)
