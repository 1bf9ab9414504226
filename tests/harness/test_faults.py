"""Faults around the node, each provoked and cleared: one log line at either end, `/diagnostics` in between."""

import re
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from tanker_pose.msg import EstimatorStatus, FeaturePointArray

from harness import messages
from harness.conftest import StartNode
from harness.fault_cases import CASES, Case, both, nothing, scatter_markers
from harness.peer import Peer
from harness.processes import Process
from harness.scene import PACE_S, Scene, rates, stamped

# A subscriber that is stopped acknowledges nothing. The middleware keeps 8192 samples for it, and forgets it 20 s
# after its last sign of life: this many at a time fill that in a few seconds.
FLOOD = 50
FLOOD_PACE_S = 0.01

RATES = {"frame_rate_hz", "camera_info_rate_hz", "estimate_rate_hz"}


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
    # What is over by itself is shown for 3 s, in which two reports are sure to come.
    more = 1 if case.clear is nothing else 2
    seen = len(scene.reports)
    scene.step_until(lambda: len(scene.reports) >= seen + more, "more reports")
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
