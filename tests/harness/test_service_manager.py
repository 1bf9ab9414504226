"""The protocol of systemd's services: what the node says to a socket that stands where systemd's would."""

import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from harness.conftest import StartNode
from harness.peer import Peer
from harness.waiting import PATIENCE_S, wait_until

WATCHDOG_S = 0.4


class ServiceManager:
    """The socket that `NOTIFY_SOCKET` names, and what has arrived at it."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / "notify"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(self._path))
        self.heard: list[tuple[float, str]] = []

    @property
    def environment(self) -> dict[str, str]:
        return {
            "NOTIFY_SOCKET": str(self._path),
            "WATCHDOG_USEC": str(int(WATCHDOG_S * 1e6)),
        }

    def next(self, timeout_s: float = PATIENCE_S) -> str:
        """The next state; fails when none comes."""
        self._socket.settimeout(timeout_s)
        state = self._socket.recv(4096).decode().strip()
        self.heard.append((time.monotonic(), state))
        return state

    def until(self, state: str) -> None:
        """Waits for a state, past others."""
        while self.next() != state:
            pass

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[ServiceManager]:
    manager = ServiceManager(tmp_path)
    yield manager
    manager.close()


def test_a_node_is_ready_when_others_can_reach_it(
    start_node: StartNode, peer: Peer, manager: ServiceManager
) -> None:
    start_node(environment=manager.environment)

    assert manager.next() == "READY=1"
    # What was opened before it said so is in the graph as soon as discovery has run.
    wait_until(lambda: peer.node.count_subscribers("/feature_points") == 1, "the node's input")


def test_signs_of_life_come_twice_in_the_watchdogs_time_until_the_node_ends(
    start_node: StartNode, manager: ServiceManager
) -> None:
    process = start_node(environment=manager.environment)
    manager.until("READY=1")

    for _ in range(10):
        assert manager.next() == "WATCHDOG=1"
    begin, end = manager.heard[1][0], manager.heard[-1][0]
    # Nine pauses of half the watchdog's time each, and of the loop's beat on top; a busy machine makes single ones longer.
    assert end - begin >= 9 * 0.4 * WATCHDOG_S
    process.send(signal.SIGINT)
    manager.until("STOPPING=1")
    assert process.wait() == 0


def test_a_managed_node_gives_signs_of_life_before_it_is_configured(
    start_node: StartNode, manager: ServiceManager
) -> None:
    start_node("-p", "lifecycle:=true", environment=manager.environment)
    manager.until("READY=1")

    for _ in range(3):
        assert manager.next() == "WATCHDOG=1"


def test_a_stopped_node_gives_no_sign_of_life(
    start_node: StartNode, manager: ServiceManager
) -> None:
    process = start_node(environment=manager.environment)
    manager.until("WATCHDOG=1")

    process.send(signal.SIGSTOP)
    with pytest.raises(TimeoutError):
        # At most what was under way when it stopped.
        for _ in range(2):
            manager.next(2 * WATCHDOG_S)
    process.send(signal.SIGCONT)
    # The middleware does not survive it, so the node ends with an error, after which systemd starts another.
    assert process.wait() != 0


def test_without_a_service_manager_nothing_is_said_and_nothing_is_wrong(
    start_node: StartNode,
) -> None:
    process = start_node()
    wait_until(lambda: "marker map" in process.log, "the node's introduction")
    process.stop()
    assert "service manager" not in process.log


def test_a_service_manager_that_has_gone_is_a_warning(
    start_node: StartNode, tmp_path: Path
) -> None:
    gone = str(tmp_path / "nobody")
    process = start_node(environment={"NOTIFY_SOCKET": gone})
    wait_until(lambda: "the service manager (NOTIFY_SOCKET)" in process.log, "the warning")
    process.stop()
