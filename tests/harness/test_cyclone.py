"""Programs on Cyclone DDS, which many flight stacks use for ROS 2, hear the node and are heard."""

import itertools
import sys
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from tanker_pose.msg import EstimatorStatus

from harness import messages, paper
from harness.conftest import StartNode
from harness.messages import CAMERA_FRAME
from harness.waiting import wait_until

if sys.version_info >= (3, 14):
    pytest.skip("PyPI has no cyclonedds for this Python", allow_module_level=True)

from harness.cyclone import CyclonePeer, idl_type  # noqa: E402

OK, NO_CAMERA_INFO = EstimatorStatus.OK, EstimatorStatus.NO_CAMERA_INFO
PARAMETER_VALUE_DOUBLE = 3
PARAMETER_VALUE_STRING = 4
ON_CYCLONE = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}


@pytest.fixture
def cyclone(domain: int) -> CyclonePeer:
    return CyclonePeer(domain)


def as_idl(name: str, message: Any) -> Any:
    """A message of rclpy as one of Cyclone: on the wire they are the same."""
    return idl_type(name).deserialize(serialize_message(message))


def test_frames_of_a_cyclone_publisher_are_answered_with_poses_and_statuses(
    start_node: StartNode, cyclone: CyclonePeer
) -> None:
    start_node()
    infos = cyclone.publisher("/camera_info", "sensor_msgs/msg/CameraInfo")
    points = cyclone.publisher("/feature_points", "tanker_pose/msg/FeaturePointArray")
    poses = cyclone.subscription("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped")
    statuses = cyclone.subscription("/status", "tanker_pose/msg/EstimatorStatus")
    wait_until(
        lambda: all(writer.get_matched_subscriptions() for writer in (infos, points))
        and all(reader.get_matched_publications() for reader in (poses, statuses)),
        "the node and its Cyclone peer to find each other",
    )
    infos.write(as_idl("sensor_msgs/msg/CameraInfo", messages.camera_info()))

    heard: list[Any] = []
    said: list[Any] = []
    indices = itertools.count(1)

    def ask() -> None:
        frame = messages.exact_frame(next(indices))
        points.write(as_idl("tanker_pose/msg/FeaturePointArray", frame))
        before = len(said)
        wait_until(lambda: bool(said.extend(statuses.take(10)) or said[before:]), "a status")
        heard.extend(poses.take(10))

    # The camera info and the frames have no common order: the first frames may come before it.
    wait_until(lambda: len(heard) >= 20, "twenty poses", pause=ask)

    assert {status.outcome for status in said} <= {OK, NO_CAMERA_INFO}, said
    for pose in heard:
        assert pose.header.frame_id == CAMERA_FRAME
        at = pose.pose.pose.position
        np.testing.assert_allclose([at.x, at.y, at.z], paper.POSE.translation, atol=1e-5)
        covariance = np.reshape(pose.pose.covariance, (6, 6))
        assert np.all(np.linalg.eigvalsh(covariance) > 0)


def get_parameters(cyclone: CyclonePeer, names: list[str]) -> list[Any]:
    return cyclone.call(
        "/tanker_pose/get_parameters",
        "rcl_interfaces/srv/GetParameters",
        "string[] names",
        "rcl_interfaces/ParameterValue[] values",
        names=names,
    ).values


def test_a_cyclone_client_reads_parameters_of_a_node_that_is_told_of_it(
    start_node: StartNode, cyclone: CyclonePeer
) -> None:
    start_node("-p", "pixel_sigma_px:=0.75", environment=ON_CYCLONE)

    sigma, method = get_parameters(cyclone, ["pixel_sigma_px", "initialisation"])

    assert (sigma.type, sigma.double_value) == (PARAMETER_VALUE_DOUBLE, 0.75)
    assert method.type == PARAMETER_VALUE_STRING


def test_a_long_reply_reaches_a_cyclone_client_too(
    start_node: StartNode, cyclone: CyclonePeer
) -> None:
    start_node(environment=ON_CYCLONE)
    names = ["pixel_sigma_px"] * 100

    values = get_parameters(cyclone, names)

    assert [value.double_value for value in values] == [0.5] * len(names)
