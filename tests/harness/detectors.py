"""Detectors of others, as they would see the tanker: vision_msgs and apriltag_msgs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from apriltag_msgs.msg import AprilTagDetection, AprilTagDetectionArray
from apriltag_msgs.msg import Point as TagPoint
from std_msgs.msg import Header
from vision_msgs.msg import (
    BoundingBox2D,
    Detection2D,
    Detection2DArray,
    ObjectHypothesis,
    ObjectHypothesisWithPose,
    Point2D,
    Pose2D,
)

from harness import messages, paper
from harness.estimator import Detector
from harness.rotations import Array, Pose, about_x, about_y, about_z

VISION = Detector(Detection2DArray, "/detections")
APRILTAGS = Detector(AprilTagDetectionArray, "/detections")


def header(index: int) -> Header:
    """Camera and time of an image."""
    return Header(stamp=messages.stamp_of(index), frame_id=messages.CAMERA_FRAME)


# ---- vision_msgs ---------------------------------------------------------------------------------


def hypothesis(class_id: str, score: float) -> ObjectHypothesisWithPose:
    """One of the things that a detection may be."""
    return ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id=class_id, score=score))


def box(u: float, v: float, marker: str = "", classes: dict[str, float] | None = None):
    """A detection with its marker in `id`, or in one of several classes with scores."""
    centre = Pose2D(position=Point2D(x=float(u), y=float(v)))
    return Detection2D(
        id=marker,
        results=[hypothesis(name, score) for name, score in (classes or {}).items()],
        bbox=BoundingBox2D(center=centre, size_x=6.0, size_y=4.0),
    )


def boxes(index: int, pixels: Array | None = None) -> Detection2DArray:
    """A box for each of the paper's markers, named by `id`."""
    pixels = paper.marker_pixels(paper.POSE) if pixels is None else pixels
    # As in messages.feature_points.
    pixels = np.asarray(pixels) + 1e-9 * (index % 1000)
    return Detection2DArray(
        header=header(index),
        detections=[
            box(u, v, str(marker)) for marker, (u, v) in zip(paper.MARKERS, pixels, strict=True)
        ],
    )


def classified_boxes(index: int) -> Detection2DArray:
    """The same, named by the best of three hypotheses, as classifiers do."""
    frame = boxes(index)
    for detection in frame.detections:
        other = str(int(detection.id) % 6 + 1)
        detection.results = [
            hypothesis(other, 0.2),
            hypothesis(detection.id, 0.7),
            hypothesis("bird", 0.1),
        ]
        detection.id = ""
    return frame


# ---- apriltag_msgs -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tag:
    """A tag on the tanker; angles in degrees."""

    id: int
    size_m: float
    position: tuple[float, float, float]
    roll: float = 90.0
    pitch: float = 0.0
    yaw: float = -90.0

    def corners(self) -> Array:
        """Bottom left, bottom right, top right, top left for who looks at the upright tag; tanker frame."""
        roll, pitch, yaw = np.radians([self.roll, self.pitch, self.yaw])
        tanker_from_tag = about_z(yaw) @ about_y(pitch) @ about_x(roll)
        half = self.size_m / 2
        in_tag = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
        return in_tag @ tanker_from_tag.T + self.position


# Upright and facing aft, but for the last: on the side of the fin, turned by half a right angle.
TAGS = [
    Tag(0, 1.2, (3.7, -6.0, 0.7)),
    Tag(5, 1.2, (3.7, 6.0, 0.7)),
    Tag(12, 0.8, (7.9, 0.3, 2.5), roll=80.0, pitch=45.0, yaw=-60.0),
]
# A tag of unknown size, of which the centre alone is known.
SINGLE = 30
SINGLE_POSITION = (0.0, 0.0, 0.0)

POINT_IDS = [10 * tag.id + corner for tag in TAGS for corner in range(4)]


def write_tag_map(path: Path) -> Path:
    """The marker map of these tags."""
    x, y, z = SINGLE_POSITION
    lines = ["name: tagged", "markers:", f"  - {{id: {SINGLE}, x: {x}, y: {y}, z: {z}}}", "tags:"]
    for tag in TAGS:
        x, y, z = tag.position
        lines.append(
            f"  - {{id: {tag.id}, family: tag36h11, size_m: {tag.size_m}, x: {x}, y: {y}, z: {z}, "
            f"roll_deg: {tag.roll}, pitch_deg: {tag.pitch}, yaw_deg: {tag.yaw}}}"
        )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def tag_detection(tag: int, corners: Array, centre: Array) -> AprilTagDetection:
    """What AprilTag's library says of a tag: it counts from the corner of the top-left pixel."""

    def point(pixel: Array) -> TagPoint:
        return TagPoint(x=float(pixel[0]) + 0.5, y=float(pixel[1]) + 0.5)

    return AprilTagDetection(
        family="tag36h11",
        id=tag,
        hamming=0,
        decision_margin=60.0,
        corners=[point(corner) for corner in corners],
        centre=point(centre),
    )


def tags(
    index: int,
    pose: Pose = paper.POSE,
    rng: np.random.Generator | None = None,
    sigma_px: float = messages.SIGMA_PX,
) -> AprilTagDetectionArray:
    """All tags, seen from `pose`; with noise if there is a generator."""

    def see(points: Array) -> Array:
        pixels = paper.CAMERA.project(pose.transform(points)) + 1e-9 * (index % 1000)
        return pixels if rng is None else pixels + rng.normal(0.0, sigma_px, pixels.shape)

    detections = []
    for tag in TAGS:
        centre = see(np.array([tag.position]))[0]
        detections.append(tag_detection(tag.id, see(tag.corners()), centre))
    single = see(np.array([SINGLE_POSITION]))
    detections.append(tag_detection(SINGLE, np.repeat(single, 4, axis=0), single[0]))
    return AprilTagDetectionArray(header=header(index), detections=detections)
