"""A camera, a detector and a simulator around the node, each of which speaks while it is switched on."""

from collections.abc import Callable

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Quaternion
from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Imu
from std_msgs.msg import Header
from tanker_pose.msg import FeaturePointArray

from harness import messages
from harness.peer import BEST_EFFORT, Peer
from harness.processes import Process

PACE_S = 0.05
# Frames of the approach in messages are 20 ms apart: every third one is as fast as the steps, and faults go by stamps.
FRAMES_PER_STEP = 3
# Silence counts from 5 s on, and is looked for once a second.
PATIENCE_S = 20.0
SIMULATED_S = 1000


class Scene:
    """A camera, a detector and a simulator, each of which speaks while it is switched on."""

    def __init__(self, peer: Peer, process: Process) -> None:
        self.peer = peer
        self.process = process
        self.reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
        self.publishers: dict[str, object] = {}
        self.others: list[object] = []
        self.speaking: set[str] = set()
        self.frame_id = messages.CAMERA_FRAME
        self.index = 0
        self.clock_s = SIMULATED_S

    def have(self, *topics: str) -> None:
        """Adds publishers that say nothing yet."""
        kinds = {
            "/camera_info": CameraInfo,
            "/feature_points": FeaturePointArray,
            "/clock": Clock,
            "/mavros/imu/data": Imu,
            "/tanker_attitude": Imu,
        }
        for topic in topics:
            if topic not in self.publishers:
                self.publishers[topic] = self.peer.node.create_publisher(
                    kinds[topic], topic, BEST_EFFORT
                )

    def speak(self, *topics: str) -> None:
        self.have(*topics)
        self.speaking |= set(topics)

    def hush(self, *topics: str) -> None:
        self.speaking -= set(topics)

    def remove(self, topic: str) -> None:
        self.hush(topic)
        self.peer.node.destroy_publisher(self.publishers.pop(topic))

    def step(self) -> None:
        self.index += 1
        self.clock_s += 1
        for topic in self.speaking:
            self.publishers[topic].publish(self.message(topic))
        self.peer.spin_for(PACE_S)

    def message(self, topic: str) -> object:
        if topic == "/camera_info":
            return messages.camera_info()
        if topic == "/clock":
            return Clock(clock=Time(sec=self.clock_s))
        if topic in ("/mavros/imu/data", "/tanker_attitude"):
            # Both fly straight to the east, alike.
            stamp = messages.stamp_of(FRAMES_PER_STEP * self.index)
            return Imu(header=Header(stamp=stamp), orientation=Quaternion(w=1.0))
        frame = messages.exact_frame(FRAMES_PER_STEP * self.index)
        frame.header.frame_id = self.frame_id
        return frame

    def steps_for(self, duration_s: float) -> None:
        for _ in range(round(duration_s / PACE_S)):
            self.step()

    def fault(self, key: str) -> str | None:
        """What the latest report says of a fault."""
        if not self.reports:
            return None
        (status,) = (s for s in self.reports[-1].status if s.name.endswith(": faults"))
        (value,) = (pair.value for pair in status.values if pair.key == key)
        assert (status.level == DiagnosticStatus.OK) == (not any(p.value for p in status.values))
        return value

    def step_until(self, condition: Callable[[], bool], what: str) -> None:
        # The node's log tells more than a time-out would.
        try:
            self.peer.spin_until(lambda: self.step() or condition(), what, PATIENCE_S)
        except AssertionError as error:
            raise AssertionError(f"{error}:\n{self.process.log}") from error

    def lines(self, beginning: str) -> list[str]:
        """Log lines of a fault that begin so, after what every line begins with."""
        return [line for line in self.process.log.splitlines() if f": {beginning}" in line]


def rates(scene: Scene) -> dict[str, float]:
    """The rates of the latest report that are not zero."""
    if not scene.reports:
        return {}
    values = {pair.key: pair.value for pair in scene.reports[-1].status[0].values}
    found = {key: float(value) for key, value in values.items() if key.endswith("_rate_hz")}
    return {key: value for key, value in found.items() if value > 0.0}


def stamped(message, now, by_s: float = 0.0):
    message.header.stamp = (now + Duration(nanoseconds=int(by_s * 1e9))).to_msg()
    return message
