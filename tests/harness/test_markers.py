"""What RViz and Foxglove draw: every marker where the geometry says, and nothing of older frames."""

import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from harness import messages, paper
from harness.conftest import StartEstimator
from harness.estimator import Answer, Estimator
from harness.messages import covariance_of, key, pose_of
from harness.peer import Peer
from harness.rotations import Array, from_quaternion
from harness.typestore import typestore

# m; rounding, as the numbers pass through pixels and back.
ROUNDING_M = 1e-9

# Half axes of the ellipsoid, and the depth of the frustum, as docs/inputs.md states them.
SIGMAS = 3.0
FRUSTUM_M = 2.0


@pytest.fixture
def drawn(peer: Peer) -> list[MarkerArray]:
    """All marker arrays received."""
    return peer.collect(MarkerArray, "/markers")


@pytest.fixture
def estimator(drawn: list[MarkerArray], start_estimator: StartEstimator) -> Estimator:
    """A node that publishes markers, with the paper's camera."""
    estimator = start_estimator("-p", "publish_markers:=true")
    estimator.use_camera()
    return estimator


def markers_of(answer: Answer, drawn: list[MarkerArray], estimator: Estimator) -> list[Marker]:
    """The markers of a frame, once they have come."""
    stamp = key(answer.status.header.stamp)

    def found() -> list[MarkerArray]:
        return [array for array in drawn if key(array.markers[0].header.stamp) == stamp]

    estimator.peer.spin_until(lambda: bool(found()), "the markers of the frame")
    (array,) = found()
    return list(array.markers)


def shown(markers: list[Marker]) -> dict[str, Marker]:
    """What is drawn, by name; the rest is asserted to be one removal of everything, before it."""
    clear, *rest = markers
    assert clear.action == Marker.DELETEALL
    assert all(marker.action == Marker.ADD for marker in rest)
    by_name = {marker.ns: marker for marker in rest}
    assert len(by_name) == len(rest)
    return by_name


def points(marker: Marker) -> Array:
    return np.array([[point.x, point.y, point.z] for point in marker.points])


def pixels(points_in_camera: Array) -> Array:
    return paper.CAMERA.project(points_in_camera)


def test_points_and_rays_are_where_pose_and_pixels_put_them(
    estimator: Estimator, drawn: list[MarkerArray], rng: np.random.Generator
) -> None:
    frame = messages.noisy_frame(estimator.next_index(), paper.POSE, rng)
    answer = estimator.expect_pose(frame)

    found = shown(markers_of(answer, drawn, estimator))

    assert set(found) == {"used", "used_rays", "camera", "covariance"}
    for marker in found.values():
        assert marker.header == frame.header
        assert 0.0 < marker.lifetime.sec + 1e-9 * marker.lifetime.nanosec < 5.0
        assert marker.color.a > 0.0
    estimated = pose_of(answer.pose.pose.pose).transform(np.array(list(paper.MARKERS.values())))
    assert np.abs(points(found["used"]) - estimated).max() < ROUNDING_M
    begins, ends = points(found["used_rays"])[::2], points(found["used_rays"])[1::2]
    assert not begins.any()
    detected = np.array([[point.u, point.v] for point in frame.points])
    assert np.abs(pixels(ends) - detected).max() < 1e-6
    assert np.abs(ends[:, 2] - estimated[:, 2]).max() < ROUNDING_M


def test_the_ellipsoid_has_the_axes_of_the_position_covariance(
    estimator: Estimator, drawn: list[MarkerArray]
) -> None:
    answer = estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    ellipsoid = shown(markers_of(answer, drawn, estimator))["covariance"]

    position = covariance_of(answer.pose)[:3, :3]
    diameters = np.array([ellipsoid.scale.x, ellipsoid.scale.y, ellipsoid.scale.z])
    expected = 2 * SIGMAS * np.sqrt(np.linalg.eigvalsh(position))
    assert np.sort(diameters) == pytest.approx(expected, rel=1e-9)
    q = ellipsoid.pose.orientation
    axes = from_quaternion(q.x, q.y, q.z, q.w)
    rebuilt = axes @ np.diag((diameters / (2 * SIGMAS)) ** 2) @ axes.T
    assert np.abs(rebuilt - position).max() < 1e-9 * np.abs(position).max()
    assert ellipsoid.pose.position == answer.pose.pose.pose.position


def test_a_wrong_detection_is_red_and_where_it_was_detected(
    estimator: Estimator, drawn: list[MarkerArray]
) -> None:
    frame = messages.exact_frame(estimator.next_index())
    frame.points[2].u += 30.0
    answer = estimator.expect_pose(frame)
    assert list(answer.status.rejected_ids) == [3]

    found = shown(markers_of(answer, drawn, estimator))

    (wrong,) = points(found["rejected"])
    assert pixels(np.array([wrong]))[0] == pytest.approx([frame.points[2].u, frame.points[2].v])
    for name in ("rejected", "rejected_rays"):
        colour = found[name].color
        assert colour.r > 0.8 and colour.g < 0.2 and colour.b < 0.2
    assert len(points(found["used"])) == 5


def test_markers_that_are_not_seen_are_drawn_as_such(
    estimator: Estimator, drawn: list[MarkerArray]
) -> None:
    frame = messages.exact_frame(estimator.next_index())
    hidden = frame.points[4]
    frame.points = [point for point in frame.points if point is not hidden]
    answer = estimator.expect_pose(frame)

    found = shown(markers_of(answer, drawn, estimator))

    assert pixels(points(found["unseen"]))[0] == pytest.approx([hidden.u, hidden.v], abs=0.01)


def test_the_frustum_goes_through_the_corners_of_the_image(
    estimator: Estimator, drawn: list[MarkerArray]
) -> None:
    answer = estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    lines = points(shown(markers_of(answer, drawn, estimator))["camera"])

    corners = lines[1::4]
    assert np.abs(corners[:, 2] - FRUSTUM_M).max() < ROUNDING_M
    right, bottom = paper.CAMERA.width - 0.5, paper.CAMERA.height - 0.5
    expected = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
    assert np.abs(pixels(corners) - expected).max() < 1e-6


def test_a_refused_frame_removes_the_tanker_and_leaves_the_camera(
    estimator: Estimator, drawn: list[MarkerArray]
) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    unknown = messages.exact_frame(estimator.next_index())
    unknown.points[0].id = 99

    answer = estimator.expect_refusal(unknown, "UNKNOWN_ID")

    assert set(shown(markers_of(answer, drawn, estimator))) == {"camera"}


def test_a_frame_of_another_camera_removes_everything(
    estimator: Estimator, drawn: list[MarkerArray]
) -> None:
    other = messages.exact_frame(estimator.next_index())
    other.header.frame_id = "another_camera"

    answer = estimator.expect_refusal(other, "FRAME_MISMATCH")

    assert shown(markers_of(answer, drawn, estimator)) == {}


def test_the_wire_is_that_of_ros_to_the_byte(estimator: Estimator, peer: Peer) -> None:
    raw: list[bytes] = peer.collect(MarkerArray, "/markers", raw=True)
    estimator.ask_until(messages.exact_frame, lambda _: bool(raw), "markers on the wire")

    # Not with rclpy's serialiser, which leaves the padding as it finds it.
    store, kind = typestore(), "visualization_msgs/msg/MarkerArray"
    decoded = store.deserialize_cdr(raw[-1], kind)

    assert len(decoded.markers) == 5
    assert bytes(store.serialize_cdr(decoded, kind)) == raw[-1]


def test_no_markers_unless_asked_for(start_estimator: StartEstimator, peer: Peer) -> None:
    estimator = start_estimator()
    estimator.use_camera()
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    assert peer.node.count_publishers("/markers") == 0
