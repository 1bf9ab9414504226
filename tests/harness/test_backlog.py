"""A node that was held up answers the newest frames, and says how many it passed over.

Its standard error is a pipe that nobody reads, as of a terminal after Ctrl-S: the node's loop stops at its next log
line, and the middleware's threads go on.
"""

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from harness import messages
from harness.estimator import Estimator
from harness.messages import key
from harness.peer import BEST_EFFORT, RELIABLE, Peer
from harness.processes import Process, binary

# Fewer than the middleware keeps in any case.
BURST = 60
PACE_S = 0.002
# For answers that must not come, and for a loop that has to be at rest.
QUIET_S = 1.0
# Quality of service of the input when nothing is overridden.
DEPTH = 10


class Terminal:
    """A pipe that is copied to a file, unless it is held: then it is full."""

    def __init__(self, log: Path) -> None:
        self._log = log
        self._reads, self.writes = os.pipe()
        self._flows = threading.Event()
        self._flows.set()
        self._copying = threading.Thread(target=self._copy, daemon=True)
        self._copying.start()

    def _copy(self) -> None:
        with self._log.open("ab") as log:
            while chunk := os.read(self._reads, 4096):
                log.write(chunk)
                log.flush()
                self._flows.wait()

    def hold(self) -> None:
        self._flows.clear()
        # Opened anew, so that only this end does not wait.
        filling = os.open(f"/proc/self/fd/{self.writes}", os.O_WRONLY | os.O_NONBLOCK)
        try:
            while True:
                os.write(filling, b"\n")
        except BlockingIOError:
            pass
        finally:
            os.close(filling)

    def release(self) -> None:
        self._flows.set()

    def close(self) -> None:
        self.release()
        os.close(self.writes)
        self._copying.join(timeout=5.0)
        os.close(self._reads)


class Held:
    """A node that can be held up."""

    def __init__(self, estimator: Estimator, terminal: Terminal, log: Path) -> None:
        self.estimator = estimator
        self.terminal = terminal
        self._log = log

    @property
    def log(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")

    def send_burst(self) -> list[tuple[int, int]]:
        """Stamps of the frames that the node finds when it goes on."""
        estimator = self.estimator
        self.terminal.hold()
        try:
            # The node warns of it, and waits.
            unknown = messages.exact_frame(estimator.next_index())
            unknown.points[0].id = 4711
            estimator.send(unknown)
            estimator.peer.spin_for(QUIET_S)
            assert key(unknown.header.stamp) not in estimator.statuses, "the node was not held up"
            stamps = []
            for _ in range(BURST):
                frame = messages.exact_frame(estimator.next_index())
                stamps.append(key(frame.header.stamp))
                estimator.send(frame)
                estimator.peer.spin_for(PACE_S)
            estimator.peer.spin_for(QUIET_S)
        finally:
            self.terminal.release()
        return stamps


@pytest.fixture
def start_held(domain: int, peer: Peer, tmp_path: Path) -> Iterator[Callable[..., Held]]:
    """Starts a node with the paper's camera that answers frames, and can be held up."""
    log = tmp_path / "node.log"
    terminal = Terminal(log)
    started: list[Process] = []

    def start(*ros_arguments: str, qos=BEST_EFFORT) -> Held:
        command = [str(binary("tanker_pose_node")), "--ros-args", *ros_arguments]
        process = Process(command, domain, tmp_path / "node", {}, output=terminal.writes)
        started.append(process)
        estimator = Estimator(peer, process, qos=qos)
        estimator.wait_until_heard()
        estimator.use_camera()
        estimator.expect_pose(messages.exact_frame(estimator.next_index()))
        return Held(estimator, terminal, log)

    yield start
    terminal.release()
    try:
        for process in started:
            process.stop()
    finally:
        for process in started:
            process.kill_if_running()
        terminal.close()
        print(log.read_text(encoding="utf-8", errors="replace"))


def answered(estimator: Estimator, stamps: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Those of the stamps that have a status, once all are there that come."""
    estimator.peer.spin_until(lambda: stamps[-1] in estimator.statuses, "the newest frame's status")
    estimator.peer.spin_for(QUIET_S)
    return [stamp for stamp in stamps if stamp in estimator.statuses]


def override(policy: str, value: object) -> tuple[str, str]:
    return "-p", f"qos_overrides./feature_points.subscription.{policy}:={value}"


@pytest.mark.parametrize(
    "arguments, qos, depth",
    [
        ((), BEST_EFFORT, DEPTH),
        (override("depth", 3), BEST_EFFORT, 3),
        (override("reliability", "reliable"), RELIABLE, DEPTH),
    ],
    ids=["default", "depth overridden", "reliable"],
)
def test_after_a_pause_only_the_newest_frames_are_answered_and_the_others_counted(
    start_held: Callable[..., Held], peer: Peer, arguments: tuple[str, ...], qos, depth: int
) -> None:
    reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
    node = start_held(*arguments, qos=qos)

    def value(key: str) -> str:
        (found,) = (p.value for s in reports[-1].status for p in s.values if p.key == key)
        return found

    # A reliable publisher may have repeated what it sent before it was heard, all of it at once.
    seen = len(reports)
    peer.spin_until(lambda: len(reports) > seen + 1, "two reports")
    peer.spin_until(lambda: value("lost_input") == "", "a node that has caught up")
    before = int(value("lost"))

    stamps = node.send_burst()

    assert answered(node.estimator, stamps) == stamps[-depth:]
    lost = BURST - depth
    peer.spin_until(lambda: int(value("lost")) == before + lost, f"{lost} more lost frames")
    words = f"lost_input: {lost} message(s) on feature_points"
    peer.spin_until(lambda: words in node.log, "the loss in the log")
    over = node.log.count("lost_input is over")
    peer.spin_until(lambda: value("lost_input") == "", "the end of the fault")
    peer.spin_until(lambda: node.log.count("lost_input is over") > over, "the end in the log")


def test_keep_all_answers_every_frame_after_a_pause(start_held: Callable[..., Held]) -> None:
    node = start_held(*override("history", "keep_all"))

    stamps = node.send_burst()

    assert answered(node.estimator, stamps) == stamps
    assert "lost_input" not in node.log
