"""The attitudes that both aircraft report decide between the two poses of a flat target, and never make a wrong one."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion
from px4_msgs.msg import VehicleAttitude
from sensor_msgs.msg import Imu
from std_msgs.msg import Header
from tanker_pose.msg import EstimatorStatus

from harness import messages, paper
from harness.conftest import StartEstimator
from harness.estimator import Answer, Estimator
from harness.marker_maps import write_marker_map
from harness.peer import BEST_EFFORT, Peer
from harness.rotations import (
    Array,
    Pose,
    about_x,
    about_y,
    about_z,
    from_quaternion,
    log,
    to_quaternion,
)
from harness.sinks import FRD_FROM_FLU, NED_FROM_ENU

# In a plane but for 30 cm.
FLAT = {
    1: (3.7, -7.13, 0.7),
    2: (3.7, 7.13, 0.7),
    3: (3.6, -2.689, 0.7),
    4: (3.8, 2.689, 0.7),
    5: (3.7, -4.5, 1.9),
    6: (3.7, 4.5, 1.9),
    7: (3.85, 0.0, -1.0),
    8: (3.55, 0.0, 3.189),
}
SIGMA_DEG = 2.0
# Roll, pitch and yaw of the mount, and of the tanker in the receiver: no sign is without effect.
MOUNT_DEG = (4.0, -13.0, 5.0)
RELATIVE_DEG = (6.0, 3.0, 7.0)
# Detections and attitudes are exact, so the estimate is, up to what the fit leaves.
EXACT_DEG = 0.05
# Stamps of attitudes about an image, in frames of 20 ms; the tanker's come through a data link, seldom and late.
RECEIVER_AT = (-3, -2, -1, 0, 1)
TANKER_AT = (-9, -3)


def turned(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Array:
    roll, pitch, yaw = np.radians([roll_deg, pitch_deg, yaw_deg])
    return about_z(yaw) @ about_y(pitch) @ about_x(roll)


def ned_from_receiver(index: float) -> Array:
    """FRD; it turns to the right at three degrees a second, nose up, right wing down."""
    yaw = np.radians(40.0 + 3.0 * index * messages.FRAME_PERIOD_NS * 1e-9)
    return about_z(yaw) @ about_y(np.radians(4.0)) @ about_x(np.radians(9.0))


def ned_from_tanker(index: float, relative: Array) -> Array:
    return ned_from_receiver(index) @ FRD_FROM_FLU @ relative @ FRD_FROM_FLU


def vehicle_attitude(index: int) -> VehicleAttitude:
    stamp = messages.stamp_of(index)
    stamp_us = stamp.sec * 1_000_000 + stamp.nanosec // 1000
    x, y, z, w = to_quaternion(ned_from_receiver(index))
    return VehicleAttitude(
        timestamp=stamp_us, timestamp_sample=stamp_us, q=np.array([w, x, y, z], dtype=np.float32)
    )


def imu(index: int, ned_from_frd: Array) -> Imu:
    """ENU from FLU, without rates."""
    x, y, z, w = to_quaternion(NED_FROM_ENU.T @ ned_from_frd @ FRD_FROM_FLU)
    header = Header(stamp=messages.stamp_of(index), frame_id="base_link")
    return Imu(header=header, orientation=Quaternion(x=x, y=y, z=z, w=w))


SOURCES: dict[str, tuple[type, str, Callable[[int], Any]]] = {
    "px4": (VehicleAttitude, "/fmu/out/vehicle_attitude", vehicle_attitude),
    "imu": (Imu, "/mavros/imu/data", lambda index: imu(index, ned_from_receiver(index))),
}


class Pair:
    """A node, and the attitudes of both aircraft for its images."""

    def __init__(
        self, peer: Peer, start: StartEstimator, source: str, markers: dict, *arguments: str
    ) -> None:
        self.peer = peer
        self.markers = markers
        self.relative = turned(*RELATIVE_DEG)
        self.tanker_error = np.eye(3)
        self.speaking = {"receiver", "tanker"}
        kind, topic, self._tell = SOURCES[source]
        self._receiver = peer.node.create_publisher(kind, topic, BEST_EFFORT)
        self._tanker = peer.node.create_publisher(Imu, "/tanker_attitude", BEST_EFFORT)
        names = ("roll", "pitch", "yaw")
        mount = [
            argument
            for name, angle in zip(names, MOUNT_DEG, strict=True)
            for argument in ("-p", f"camera_mount_{name}_deg:={angle}")
        ]
        self.estimator: Estimator = start(
            *("-p", f"attitude:={source}", "-p", f"reported_attitude_sigma_deg:={SIGMA_DEG}"),
            *("-p", "track:=false"),
            *mount,
            *arguments,
        )
        self.estimator.use_camera()

    def truth(self, range_m: float) -> Pose:
        camera_from_receiver = paper.CAMERA_FROM_RECEIVER @ turned(*MOUNT_DEG).T
        # Near the optical axis, seventeen degrees above the tanker's level.
        place = turned(*MOUNT_DEG) @ np.array([range_m, 0.02 * range_m, 0.07 * range_m])
        return Pose(camera_from_receiver @ self.relative, camera_from_receiver @ place)

    def ask(self, range_m: float) -> Answer:
        """The answer to an image, once the attitudes about it are there."""
        # Far enough from the last one that its attitudes are too old.
        index = 100 * self.estimator.next_index()
        if "receiver" in self.speaking:
            for step in RECEIVER_AT:
                self._receiver.publish(self._tell(index + step))
        if "tanker" in self.speaking:
            for step in TANKER_AT:
                attitude = ned_from_tanker(index + step, self.relative) @ self.tanker_error
                self._tanker.publish(imu(index + step, attitude))
        self.peer.spin_for(0.05)
        pixels = paper.marker_pixels(self.truth(range_m), paper.CAMERA, self.markers)
        assert paper.CAMERA.sees(pixels, margin_px=3.0)
        return self.estimator.ask(
            messages.feature_points(index, pixels, ids=self.markers, sigmas_px=0.5)
        )

    def ask_until_heard(self, range_m: float) -> Answer:
        """The same, from the time on at which the node hears both."""
        answers: list[Answer] = []

        def heard() -> bool:
            answers.append(self.ask(range_m))
            return "need 2 samples" not in answers[-1].status.message

        self.peer.spin_until(heard, "the node to hear both attitudes")
        return answers[-1]

    def off_deg(self, answer: Answer, range_m: float) -> float:
        q = answer.pose.pose.pose.orientation
        found = from_quaternion(q.x, q.y, q.z, q.w)
        turn = log(found @ self.truth(range_m).rotation.T)
        return float(np.degrees(np.linalg.norm(turn)))


@pytest.mark.parametrize("source", SOURCES)
def test_a_flat_target_is_answered_as_long_as_both_aircraft_report(
    peer: Peer, start_estimator: StartEstimator, tmp_path: Path, source: str
) -> None:
    flat = write_marker_map(tmp_path / "flat.yaml", FLAT)
    pair = Pair(peer, start_estimator, source, FLAT, "-p", f"marker_map:={flat}")

    pair.speaking = {"receiver"}
    answer = pair.ask(70.0)
    assert answer.outcome == "AMBIGUOUS"
    assert "no reported attitude: the tanker's attitude: need 2 samples" in answer.status.message

    pair.speaking = {"receiver", "tanker"}
    answer = pair.ask_until_heard(70.0)
    assert answer.outcome == "OK", answer.status.message
    assert answer.status.message == ""
    assert answer.status.initialisation == EstimatorStatus.INITIALISATION_NOMINAL
    assert pair.off_deg(answer, 70.0) < EXACT_DEG
    # Of the turns, none of which the image knows better than some degrees.
    covariance = np.array(answer.pose.pose.covariance).reshape(6, 6)
    sigmas_deg = np.degrees(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])))
    assert sigmas_deg.max() < SIGMA_DEG * 1.001
    # Eight points, six numbers of a pose, three of the prior.
    assert answer.status.degrees_of_freedom == 2 * 8 - 6 + 3

    # It falls silent: the image is ambiguous again, and the node says why.
    for silent, words in [
        ("tanker", "the tanker's attitude: its newest sample is"),
        ("receiver", "the receiver's attitude: its newest sample is"),
    ]:
        pair.speaking = {"receiver", "tanker"} - {silent}
        answer = pair.ask(70.0)
        assert answer.outcome == "AMBIGUOUS"
        assert f"no reported attitude: {words}" in answer.status.message
    pair.speaking = {"receiver", "tanker"}
    assert pair.ask(70.0).outcome == "OK"
    begins = [
        line for line in pair.estimator.process.log.splitlines() if ": no_reported_attitude: " in line
    ]
    assert len(begins) == 1 and "[WARN]" in begins[0], begins


def test_attitudes_that_contradict_the_image_make_no_pose(
    peer: Peer, start_estimator: StartEstimator
) -> None:
    pair = Pair(peer, start_estimator, "imu", paper.MARKERS)
    answer = pair.ask_until_heard(15.0)
    assert answer.outcome == "OK", answer.status.message
    assert pair.off_deg(answer, 15.0) < EXACT_DEG

    # A heading that is off; the relative attitude stays within max_attitude_deviation_deg.
    for heading_deg in (12.0, 15.0):
        pair.tanker_error = about_z(np.radians(heading_deg))
        answer = pair.ask(15.0)
        assert answer.outcome == "NOT_TRUSTED", answer.status.message
        assert "what both aircraft report" in answer.status.message

    # An attitude that no tanker flies is not believed: the image alone decides.
    pair.tanker_error = about_z(np.radians(60.0))
    answer = pair.ask(15.0)
    assert answer.outcome == "OK", answer.status.message
    assert "by both attitudes the tanker stands" in answer.status.message
    assert pair.off_deg(answer, 15.0) < EXACT_DEG

    pair.tanker_error = np.eye(3)
    answer = pair.ask(15.0)
    assert answer.outcome == "OK" and answer.status.message == ""


def test_where_none_is_reported_the_nominal_prior_holds(
    peer: Peer, start_estimator: StartEstimator, tmp_path: Path
) -> None:
    flat = write_marker_map(tmp_path / "flat.yaml", FLAT)
    nominal = ("-p", "nominal_attitude_sigma_deg:=6.0")
    pair = Pair(peer, start_estimator, "imu", FLAT, "-p", f"marker_map:={flat}", *nominal)
    pair.speaking = {"receiver"}
    answer = pair.ask(70.0)
    assert answer.outcome == "OK", answer.status.message
    assert "no reported attitude: the tanker's" in answer.status.message
    by_nominal = pair.off_deg(answer, 70.0)
    pair.speaking = {"receiver", "tanker"}
    answer = pair.ask_until_heard(70.0)
    assert answer.outcome == "OK"
    # The tanker is turned by ten degrees from nominal, and the image leaves some of that open.
    assert pair.off_deg(answer, 70.0) < EXACT_DEG < by_nominal
