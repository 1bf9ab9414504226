"""The node under test with a peer wired to it: detections go in, answers come out."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header
from tanker_pose.msg import EstimatorStatus, FeaturePointArray

from harness import messages
from harness.messages import key
from harness.peer import BEST_EFFORT, RELIABLE, Peer
from harness.processes import Process
from harness.waiting import wait_until

# Probes, frames that only ask whether the node hears us, lie long before all that tests send.
_FIRST_PROBE = -1_000_000
_PROBE_PERIOD_S = 0.05

# rosidl's Python classes keep their constants in what the metaclass prepares.
OUTCOMES: dict[int, str] = {
    value: name
    for name, value in type(EstimatorStatus).__prepare__("EstimatorStatus", ()).items()
    if not name.startswith(("INITIALISATION_", "TRACK_", "CERTIFICATE_"))
}


def outcome_name(value: int) -> str:
    """The name of an outcome constant, for failures that people can read."""
    return OUTCOMES.get(value, f"unknown outcome {value}")


@dataclass(frozen=True)
class Detector:
    """What brings the detections: messages of a type, on a topic."""

    message_type: type
    topic: str


FEATURE_POINTS = Detector(FeaturePointArray, "/feature_points")


@dataclass(frozen=True)
class Topics:
    """Where a node listens and speaks."""

    feature_points: str = "/feature_points"
    camera_info: str = "/camera_info"
    pose: str = "/pose"
    status: str = "/status"

    def under(self, namespace: str) -> "Topics":
        """The same names in a namespace such as `/uav1`."""
        return Topics(*(namespace + topic for topic in vars(self).values()))


@dataclass(frozen=True)
class Answer:
    """What the node said to one frame."""

    status: EstimatorStatus
    pose: PoseWithCovarianceStamped | None

    @property
    def outcome(self) -> str:
        return outcome_name(self.status.outcome)


class Estimator:
    """A running node, heard and hearing."""

    def __init__(
        self,
        peer: Peer,
        process: Process,
        topics: Topics = Topics(),
        qos: QoSProfile = BEST_EFFORT,
        detector: Detector = FEATURE_POINTS,
    ) -> None:
        self.peer = peer
        self.process = process
        self.statuses: dict[tuple[int, int], list[EstimatorStatus]] = {}
        self.poses: dict[tuple[int, int], list[PoseWithCovarianceStamped]] = {}
        self._indices = itertools.count(1)
        self._probes = itertools.count(_FIRST_PROBE)
        node = peer.node
        # The order matters: discovery tells the node of our subscriptions one after the other, so
        # once it has found the status's, the pose's is matched too.
        node.create_subscription(PoseWithCovarianceStamped, topics.pose, self._on_pose, RELIABLE)
        node.create_subscription(EstimatorStatus, topics.status, self._on_status, RELIABLE)
        self.info_publisher = node.create_publisher(CameraInfo, topics.camera_info, qos)
        self._detector = detector
        topic = topics.feature_points if detector is FEATURE_POINTS else detector.topic
        self.points_publisher = node.create_publisher(detector.message_type, topic, qos)

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        self.poses.setdefault(key(message.header.stamp), []).append(message)

    def _on_status(self, message: EstimatorStatus) -> None:
        self.statuses.setdefault(key(message.header.stamp), []).append(message)

    def next_index(self) -> int:
        """An index, and with it a stamp, that no frame of this test has had."""
        return next(self._indices)

    def wait_until_heard(self) -> None:
        """Returns when the node answers our detections: both ways are then matched."""
        self._probe_until(lambda status: True, "the node to answer detections")

    def use_camera(self, info: CameraInfo | None = None) -> None:
        """Sends the first camera info until the node has it."""
        info = info or messages.camera_info()

        def publish_info() -> None:
            self.info_publisher.publish(info)

        self._probe_until(
            lambda status: status.outcome != EstimatorStatus.NO_CAMERA_INFO,
            "the node to receive the camera info",
            before=publish_info,
        )

    def _probe_until(
        self,
        accept: Callable[[EstimatorStatus], bool],
        what: str,
        before: Callable[[], None] = lambda: None,
    ) -> None:
        stamps: list[tuple[int, int]] = []

        def probe() -> None:
            before()
            # No node can give a pose for it, whatever its marker map, so it leaves no trace.
            header = Header(stamp=messages.stamp_of(next(self._probes)), frame_id="probe")
            frame = self._detector.message_type(header=header)
            stamps.append(key(frame.header.stamp))
            self.points_publisher.publish(frame)
            self.peer.spin_for(_PROBE_PERIOD_S)

        def answered() -> bool:
            assert self.process.running, f"the node has ended:\n{self.process.log}"
            return any(
                accept(status) for stamp in stamps for status in self.statuses.get(stamp, [])
            )

        wait_until(answered, what, pause=probe)

    def send(self, frame: Any) -> None:
        """Publishes a frame without waiting for the answer."""
        self.points_publisher.publish(frame)

    def answer_to(self, frame: Any) -> Answer:
        """The latest answer to a frame sent before; with its pose when the status promises one."""
        stamp = key(frame.header.stamp)
        self.peer.spin_until(lambda: stamp in self.statuses, f"a status for frame {stamp}")
        status = self.statuses[stamp][-1]
        if status.outcome == EstimatorStatus.OK:
            self.peer.spin_until(lambda: stamp in self.poses, f"a pose for frame {stamp}")
        return Answer(status, self.pose_for(frame))

    def ask(self, frame: Any) -> Answer:
        """Sends a frame and returns the answer."""
        self.send(frame)
        return self.answer_to(frame)

    def ask_until(
        self,
        make_frame: Callable[[int], Any],
        accept: Callable[[Answer], bool],
        what: str,
    ) -> Answer:
        """Asks with fresh frames until an answer is acceptable.

        For changes that reach the node by another topic than the frames, in no given order.
        """
        answers: list[Answer] = []

        def ask_again() -> None:
            answers.append(self.ask(make_frame(self.next_index())))

        ask_again()
        wait_until(lambda: accept(answers[-1]), what, pause=ask_again)
        return answers[-1]

    def pose_for(self, frame: Any) -> PoseWithCovarianceStamped | None:
        """The pose received so far with the frame's stamp."""
        poses = self.poses.get(key(frame.header.stamp), [])
        return poses[-1] if poses else None

    def expect_pose(self, frame: Any) -> Answer:
        """Sends a frame that must be answered with a pose."""
        answer = self.ask(frame)
        assert answer.outcome == "OK", f"{answer.outcome}: {answer.status.message}"
        assert answer.pose is not None
        return answer

    def expect_refusal(
        self,
        frame: Any,
        outcome: str,
        good_frame: Callable[[int], Any] | None = messages.exact_frame,
    ) -> Answer:
        """Sends a frame that must be refused with `outcome` and words, without ending the service.

        The good frame that follows also proves that no pose came: poses arrive in their order.
        """
        answer = self.ask(frame)
        assert answer.outcome == outcome, f"{answer.outcome}: {answer.status.message}"
        assert answer.status.message.strip(), f"{outcome} came without a word of explanation"
        if good_frame is not None:
            self.expect_pose(good_frame(self.next_index()))
        assert self.pose_for(frame) is None, (
            f"a pose was published for a frame refused as {outcome}"
        )
        return answer
