"""What comes out beside pose and status: TF, diagnostics, and the log."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from tf2_msgs.msg import TFMessage

from harness import messages, paper
from harness.conftest import StartEstimator
from harness.consistency import pose_error
from harness.estimator import Estimator
from harness.messages import key
from harness.peer import Peer
from harness.rotations import Pose, from_quaternion

EXACT = 3e-4


def test_publish_tf_tells_the_pose_as_a_transform(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    received: list[TFMessage] = peer.collect(TFMessage, "/tf")
    estimator = start_estimator("-p", "publish_tf:=true", "-p", "tanker_frame_id:=mothership")
    estimator.use_camera()
    frame = messages.exact_frame(estimator.next_index())

    answer = estimator.expect_pose(frame)
    peer.spin_until(lambda: bool(received), "a transform")

    (transform,) = received[0].transforms
    assert transform.header == frame.header
    assert transform.child_frame_id == "mothership"
    t, q = transform.transform.translation, transform.transform.rotation
    found = Pose(from_quaternion(q.x, q.y, q.z, q.w), np.array([t.x, t.y, t.z]))
    assert np.abs(pose_error(paper.POSE, found)).max() < EXACT
    assert answer.pose is not None


def test_no_transform_unless_asked_for_and_none_for_a_refusal(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    received: list[TFMessage] = peer.collect(TFMessage, "/tf")
    estimator = start_estimator("-p", "publish_tf:=true")
    estimator.use_camera()
    unknown = messages.exact_frame(estimator.next_index())
    unknown.points[0].id = 99

    estimator.expect_refusal(unknown, "UNKNOWN_ID")
    peer.spin_until(lambda: bool(received), "the good frame's transform")

    stamps = {
        key(transform.header.stamp) for message in received for transform in message.transforms
    }
    assert key(unknown.header.stamp) not in stamps


def test_diagnostics_come_once_a_second_and_count_the_outcomes(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    received: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
    estimator = start_estimator()
    estimator.use_camera()
    for _ in range(7):
        estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    for _ in range(3):
        spoilt = messages.exact_frame(estimator.next_index())
        spoilt.points[0].id = 99
        estimator.ask(spoilt)

    already = len(received)
    peer.spin_until(lambda: len(received) >= already + 4, "four more diagnostics", timeout_s=8.0)

    times = [
        message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in received[-4:]
    ]
    assert np.diff(times) == pytest.approx([1.0, 1.0, 1.0], abs=0.25)
    counts = {value.key: value.value for status in received[-1].status for value in status.values}
    assert counts["estimates"] == "7"
    assert counts["refusals.UNKNOWN_ID"] == "3"
    assert counts["refusals.NOT_TRUSTED"] == "0"
    for status in received[-1].status:
        assert status.name.startswith("tanker_pose")
        assert status.hardware_id


def test_diagnostics_say_that_nothing_arrives(start_estimator: StartEstimator, peer: Peer) -> None:
    received: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
    start_estimator()

    peer.spin_until(lambda: bool(received), "diagnostics")

    worst = max(received[0].status, key=lambda status: status.level)
    assert worst.level != DiagnosticStatus.OK, "no camera info has come, and nobody is told"
    assert worst.message.strip()


def test_rosout_carries_the_log_lines(start_estimator: StartEstimator, peer: Peer) -> None:
    received: list[Log] = peer.collect(Log, "/rosout")
    estimator = start_estimator()
    estimator.use_camera()
    spoilt = messages.exact_frame(estimator.next_index())
    spoilt.points[0].id = 4711

    estimator.expect_refusal(spoilt, "UNKNOWN_ID")

    peer.spin_until(
        lambda: any("4711" in line.msg for line in received),
        "the warning of an unknown id on /rosout",
    )
    (line, *_) = [line for line in received if "4711" in line.msg]
    assert line.name == "tanker_pose"
    assert line.level == Log.WARN
    assert "4711" in estimator.process.log


def test_a_repeated_fault_is_logged_once_not_every_frame(estimator: Estimator) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    before = len(estimator.process.log.splitlines())

    for _ in range(100):
        spoilt = messages.exact_frame(estimator.next_index())
        spoilt.points[0].id = 4711
        estimator.ask(spoilt)

    # Faults before it may be over by now, which is no warning.
    added = estimator.process.log.splitlines()[before:]
    lines = [line for line in added if "[INFO]" not in line]
    assert len(lines) == 1, "\n".join(lines)
    assert "4711" in lines[0]
