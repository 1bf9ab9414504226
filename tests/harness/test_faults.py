"""Faults around the node, each provoked and cleared: one log line at either end, `/diagnostics` in between."""

import re
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import String
from tanker_pose.msg import EstimatorStatus, FeaturePointArray

from harness import messages, paper
from harness.conftest import StartNode
from harness.peer import BEST_EFFORT, LATCHED, RELIABLE, Peer
from harness.processes import Process

PACE_S = 0.05
# Frames of the approach in messages are 20 ms apart: every third one is as fast as the steps, and faults go by stamps.
FRAMES_PER_STEP = 3
# Silence counts from 5 s on, and is looked for once a second.
PATIENCE_S = 20.0
# A camera counts as steady after 3 s.
STEADY_S = 5.0
FAR_AHEAD = 1_000_000
SIMULATED_S = 1000

# A subscriber that is stopped acknowledges nothing. The middleware keeps 8192 samples for it, and forgets it 20 s
# after its last sign of life: this many at a time fill that in a few seconds.
FLOOD = 50
FLOOD_PACE_S = 0.01

RATES = {"frame_rate_hz", "camera_info_rate_hz", "estimate_rate_hz"}


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
        kinds = {"/camera_info": CameraInfo, "/feature_points": FeaturePointArray, "/clock": Clock}
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


@dataclass(frozen=True)
class Case:
    """A fault: how it comes, what is said of it, how it goes."""

    key: str
    words: str
    provoke: Callable[[Scene], object]
    clear: Callable[[Scene], object]
    arguments: tuple[str, ...] = ()


def both(scene: Scene) -> None:
    scene.speak("/camera_info", "/feature_points")


def add_deaf_publisher(scene: Scene) -> None:
    # rclpy's own warning of it is deprecated by rclpy itself.
    quiet = PublisherEventCallbacks(use_default_callbacks=False)
    publisher = scene.peer.node.create_publisher(
        FeaturePointArray, "/feature_points", BEST_EFFORT, event_callbacks=quiet
    )
    scene.others.append(publisher)


def add_subscriber(kind: type, qos) -> Callable[[Scene], None]:
    def add(scene: Scene) -> None:
        quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
        subscription = scene.peer.node.create_subscription(
            kind, "/pose", lambda message: None, qos, event_callbacks=quiet
        )
        scene.others.append(subscription)

    return add


def add_wrong_publisher(scene: Scene) -> None:
    scene.others.append(scene.peer.node.create_publisher(String, "/camera_info", RELIABLE))


def remove_publisher(scene: Scene) -> None:
    scene.peer.node.destroy_publisher(scene.others.pop())


def remove_subscriber(scene: Scene) -> None:
    scene.peer.node.destroy_subscription(scene.others.pop())


def stop_detector(scene: Scene) -> None:
    both(scene)
    scene.steps_for(2.0)
    scene.remove("/feature_points")


def stop_camera(scene: Scene) -> None:
    both(scene)
    scene.steps_for(STEADY_S)
    scene.hush("/camera_info")


def name_another_frame(scene: Scene) -> None:
    both(scene)
    scene.frame_id = "other_camera"


def name_the_same_frame(scene: Scene) -> None:
    scene.frame_id = messages.CAMERA_FRAME


def misplace_a_marker(scene: Scene) -> None:
    # As with a map in which it stands elsewhere: it is off the same way in every image.
    both(scene)
    good = Scene.message

    def message(topic: str) -> object:
        told = good(scene, topic)
        if topic == "/feature_points":
            told.points[5].u += 30.0
        return told

    scene.message = message


def misplace_all_markers(scene: Scene) -> None:
    # A map that is some centimetres off everywhere: 2 px, the same in every image.
    spoil_pixels(scene, lambda: np.random.default_rng(5).normal(0.0, 2.0, (len(paper.MARKERS), 2)))


def scatter_markers(scene: Scene) -> None:
    # A detector that is four times worse than its sigma.
    rng = np.random.default_rng(6)
    spoil_pixels(scene, lambda: rng.normal(0.0, 4 * messages.SIGMA_PX, (len(paper.MARKERS), 2)))


def spoil_pixels(scene: Scene, errors: Callable[[], np.ndarray]) -> None:
    both(scene)
    good = Scene.message

    def message(topic: str) -> object:
        told = good(scene, topic)
        if topic == "/feature_points":
            for point, (u, v) in zip(told.points, errors(), strict=True):
                point.u += u
                point.v += v
        return told

    scene.message = message


def pitch_the_tanker(scene: Scene) -> None:
    both(scene)
    good = Scene.message
    pose = paper.camera_from_tanker(0.0, 20.0, 0.0, (15.0, 0.0, 4.5))

    def message(topic: str) -> object:
        return (
            messages.exact_frame(FRAMES_PER_STEP * scene.index, pose)
            if topic == "/feature_points"
            else good(scene, topic)
        )

    scene.message = message


def stamp_by_a_clock_that_is_ahead(by_s: float) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        scene.message = lambda topic: stamped(
            Scene.message(scene, topic), scene.peer.node.get_clock().now(), by_s
        )
        both(scene)

    return provoke


def stamp_since_start(scene: Scene) -> None:
    def message(topic: str) -> object:
        told = Scene.message(scene, topic)
        told.header.stamp = Time(sec=500 + scene.index)
        return told

    scene.message = message
    both(scene)


def jump(by: int) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        scene.index = FAR_AHEAD
        both(scene)
        # Until frames are taken, or there is nothing to jump from.
        scene.step_until(lambda: "estimate_rate_hz" in rates(scene), "estimates")
        scene.index += by

    return provoke


def rates(scene: Scene) -> dict[str, float]:
    """The rates of the latest report that are not zero."""
    if not scene.reports:
        return {}
    values = {pair.key: pair.value for pair in scene.reports[-1].status[0].values}
    found = {key: float(value) for key, value in values.items() if key.endswith("_rate_hz")}
    return {key: value for key, value in found.items() if value > 0.0}


def turn_clock(by_s: int) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        scene.speak("/clock")
        scene.step_until(
            lambda: scene.reports and scene.reports[-1].header.stamp.sec >= SIMULATED_S,
            "simulated time",
        )
        scene.clock_s += by_s

    return provoke


def send_undecodable(scene: Scene) -> None:
    # As from a definition with a field less at the end.
    both(scene)
    good = Scene.message
    scene.message = lambda topic: (
        serialize_message(good(scene, topic))[:-5]
        if topic == "/feature_points"
        else good(scene, topic)
    )


def send_good(scene: Scene) -> None:
    del scene.message


def stop_clock(scene: Scene) -> None:
    turn_clock(0)(scene)
    scene.hush("/clock")


def nothing(scene: Scene) -> None:
    """What is over by itself."""


RELIABLE_INPUT = ("-p", "qos_overrides./feature_points.subscription.reliability:=reliable")
SIM_TIME = ("-p", "use_sim_time:=true")

CASES = {
    "publisher offers less": Case(
        "incompatible_qos",
        "a publisher of /feature_points offers reliability best_effort, requested is reliable",
        add_deaf_publisher,
        remove_publisher,
        RELIABLE_INPUT,
    ),
    "subscriber requests more": Case(
        "incompatible_qos",
        "a subscriber of /pose requests durability transient_local, offered is volatile",
        add_subscriber(PoseWithCovarianceStamped, LATCHED),
        remove_subscriber,
    ),
    "publisher of another type": Case(
        "wrong_type",
        "a publisher of /camera_info sends std_msgs/msg/String, expected sensor_msgs/msg/CameraInfo",
        add_wrong_publisher,
        remove_publisher,
    ),
    "subscriber of another type": Case(
        "wrong_type",
        "a subscriber of /pose expects std_msgs/msg/String",
        add_subscriber(String, RELIABLE),
        remove_subscriber,
    ),
    "silent detector": Case(
        "silent_publisher",
        "/feature_points",
        lambda scene: scene.have("/feature_points"),
        lambda scene: scene.speak("/feature_points"),
    ),
    "silent camera": Case(
        "silent_publisher",
        "/camera_info",
        lambda scene: scene.have("/camera_info"),
        lambda scene: scene.speak("/camera_info"),
    ),
    "camera without detector": Case(
        "no_detections",
        "camera info comes on /camera_info, but /feature_points has no publisher of the right type",
        lambda scene: scene.speak("/camera_info"),
        lambda scene: scene.speak("/feature_points"),
    ),
    "detector gone": Case(
        "no_detections",
        "nothing comes on /feature_points any more",
        stop_detector,
        lambda scene: scene.speak("/feature_points"),
    ),
    "detector without camera": Case(
        "no_camera_info",
        "NO_CAMERA_INFO",
        lambda scene: scene.speak("/feature_points"),
        lambda scene: scene.speak("/camera_info"),
    ),
    "camera stops": Case(
        "stale_camera_info",
        "no camera info on /camera_info for 5 s",
        stop_camera,
        lambda scene: scene.speak("/camera_info"),
    ),
    "two frames": Case(
        "frame_mismatch", "other_camera", name_another_frame, name_the_same_frame
    ),
    "marker in the wrong place": Case(
        "suspect_marker",
        "marker 6 was left out of 100% of the frames that show it",
        misplace_a_marker,
        send_good,
    ),
    "map that is off": Case(
        "not_trusted",
        "the residuals point the same way in frame after frame: the marker map or the calibration",
        misplace_all_markers,
        send_good,
    ),
    "sigma that is too small": Case(
        "not_trusted",
        "the sigmas (pixel_sigma_px, or those of the detections) are too small",
        scatter_markers,
        send_good,
    ),
    "tanker off its nominal attitude": Case(
        "unexpected_attitude",
        "the tanker stands 20.0° off its nominal attitude",
        pitch_the_tanker,
        send_good,
    ),
    "detector's clock ahead": Case(
        "clock_offset",
        "s in the future by this machine's clock: the clock of the machine that stamps the images (camera or detector) is "
        "not synchronised",
        stamp_by_a_clock_that_is_ahead(23.0),
        stamp_by_a_clock_that_is_ahead(0.0),
    ),
    "images of yesterday": Case(
        "clock_offset",
        "s old by this machine's clock",
        stamp_by_a_clock_that_is_ahead(-86_400.0),
        stamp_by_a_clock_that_is_ahead(0.0),
    ),
    "stamps since the start of a machine": Case(
        "clock_offset",
        "they count from a start",
        stamp_since_start,
        stamp_by_a_clock_that_is_ahead(0.0),
    ),
    "stamps go back": Case("stamp_jump", "back by", jump(-1000), nothing),
    "stamps go far ahead": Case("stamp_jump", "ahead by", jump(10_000), nothing),
    "clock goes back": Case("clock_jump", "back by", turn_clock(-500), nothing, SIM_TIME),
    "clock goes far ahead": Case("clock_jump", "ahead by", turn_clock(5000), nothing, SIM_TIME),
    "detector of another definition": Case(
        "undecodable",
        "a message on feature_points cannot be decoded",
        send_undecodable,
        send_good,
    ),
    "clock stops": Case(
        "no_clock",
        "/clock has stopped",
        stop_clock,
        lambda scene: scene.speak("/clock"),
        SIM_TIME,
    ),
    "no clock": Case(
        "no_clock", "no /clock has come", nothing, lambda scene: scene.speak("/clock"), SIM_TIME
    ),
}


@pytest.fixture
def make_scene(start_node: StartNode, peer: Peer) -> Callable[..., Scene]:
    def make(*arguments: str) -> Scene:
        scene = Scene(peer, start_node(*arguments))
        peer.spin_until(lambda: len(scene.reports) > 0, "a first report")
        return scene

    return make


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_a_fault_is_said_when_it_begins_and_ends_and_shown_in_between(
    make_scene: Callable[..., Scene], case: Case
) -> None:
    scene = make_scene(*case.arguments)
    assert scene.fault(case.key) == ""

    case.provoke(scene)
    scene.step_until(lambda: case.words in (scene.fault(case.key) or ""), f"{case.key} shown")
    seen = len(scene.reports)
    scene.step_until(lambda: len(scene.reports) > seen + 1, "two more reports")
    (line,) = scene.lines(f"{case.key}: ")
    assert "[WARN]" in line and case.words in line
    assert scene.lines(f"{case.key} is over") == []

    case.clear(scene)
    scene.step_until(lambda: scene.fault(case.key) == "", f"{case.key} cleared")
    seen = len(scene.reports)
    scene.step_until(lambda: len(scene.reports) > seen, "one more report")
    assert scene.fault(case.key) == ""
    assert len(scene.lines(f"{case.key}: ")) == 1, scene.process.log
    (line,) = scene.lines(f"{case.key} is over after")
    assert "[INFO]" in line
    assert "panicked" not in scene.process.log


def test_widened_sigmas_stay_a_fault_and_the_statuses_tell_the_factor(
    make_scene: Callable[..., Scene],
) -> None:
    scene = make_scene("-p", "widen_by_sigma_factor:=true")
    statuses: list[EstimatorStatus] = scene.peer.collect(EstimatorStatus, "/status")
    scatter_markers(scene)
    words = "times their sigmas (widen_by_sigma_factor)"
    scene.step_until(lambda: words in (scene.fault("sigma") or ""), "sigma shown")
    scene.steps_for(2.0)
    latest = statuses[-20:]
    factors = [float(re.search(r"multiplied by ([0-9.]+)", s.message)[1]) for s in latest]
    assert 3.2 < min(factors) and max(factors) < 4.8, factors
    assert sum(s.outcome == EstimatorStatus.OK for s in latest) >= 18
    assert "are too small" in scene.fault("sigma")


@pytest.fixture
def subscriber(domain: int, tmp_path: Path) -> Iterator[Process]:
    """Another process that hears `/status`, and says when it does."""
    code = (
        "import rclpy; from tanker_pose.msg import EstimatorStatus\n"
        f"rclpy.init(domain_id={domain}); node = rclpy.create_node('subscriber')\n"
        "heard = lambda message: print('heard', flush=True)\n"
        "node.create_subscription(EstimatorStatus, '/status', heard, 10); rclpy.spin(node)"
    )
    process = Process([sys.executable, "-c", code], domain, tmp_path / "subscriber", {})
    yield process
    process.kill_if_running()


def test_a_subscriber_that_is_stopped_costs_messages_only_when_the_window_is_full(
    make_scene: Callable[..., Scene], subscriber: Process
) -> None:
    scene = make_scene()
    scene.speak("/feature_points")
    scene.step_until(lambda: "heard" in subscriber.log, "the subscriber to hear")
    # Without a stamp they are refused, and cost nothing to make.
    empty = FeaturePointArray()

    def flood() -> None:
        for _ in range(FLOOD):
            scene.publishers["/feature_points"].publish(empty)
            scene.peer.spin_for(FLOOD_PACE_S / FLOOD)

    subscriber.send(signal.SIGSTOP)
    try:
        scene.step = flood
        scene.step_until(lambda: "/status" in (scene.fault("dropped_output") or ""), "a drop")
        (line,) = scene.lines("dropped_output: ")
        assert "[WARN]" in line and "/status: a subscriber does not keep up" in line
    finally:
        subscriber.send(signal.SIGCONT)
    del scene.step
    scene.step_until(lambda: scene.fault("dropped_output") == "", "the end of the drops")
    (line,) = scene.lines("dropped_output is over after")
    assert "[INFO]" in line
    assert len(scene.lines("dropped_output: ")) == 1, scene.process.log


def test_a_healthy_node_reports_rates_and_latencies_and_no_faults(
    make_scene: Callable[..., Scene],
) -> None:
    scene = make_scene()
    now = scene.peer.node.get_clock()
    scene.message = lambda topic: stamped(Scene.message(scene, topic), now.now())
    both(scene)
    scene.step_until(lambda: rates(scene).keys() >= RATES, "rates of input, camera and pose")
    scene.steps_for(2.0)

    estimation, faults = scene.reports[-1].status
    assert faults.level == DiagnosticStatus.OK and faults.message == "no faults", scene.process.log
    assert estimation.hardware_id == faults.hardware_id == messages.CAMERA_FRAME
    values = {pair.key: pair.value for pair in estimation.values}
    # One message in PACE_S at most.
    assert all(0.0 < rate < 1.5 / PACE_S for rate in rates(scene).values())
    assert values["window_s"] == "10"
    assert 0.0 < float(values["latency_p50_ms"]) <= float(values["latency_p99_ms"]) < 1e3
    assert 0.0 < float(values["image_age_p50_ms"]) <= float(values["image_age_p99_ms"]) < 1e4


def stamped(message, now, by_s: float = 0.0):
    message.header.stamp = (now + Duration(nanoseconds=int(by_s * 1e9))).to_msg()
    return message
