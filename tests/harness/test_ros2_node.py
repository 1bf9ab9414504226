"""The crate `ros2_node` by itself: its example `talker`, as ROS's own tools find and drive it."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rcl_interfaces.msg import ParameterType
from std_msgs.msg import Header

from harness.peer import RELIABLE, Peer
from harness.processes import Process, example, started
from harness.test_managed_node import ACTIVATE, CONFIGURE, DEACTIVATE, Manager
from harness.test_parameter_services import Client
from harness.waiting import wait_until

NODE = "/left/talker"
TOPIC = "/left/time"
StartTalker = Callable[..., Process]


@pytest.fixture
def start_talker(domain: int, tmp_path: Path) -> Iterator[StartTalker]:
    """Starts the example in a namespace, its topic remapped; none outlives the test."""
    with started(leave_well=False) as talkers:

        def start(*ros_arguments: str) -> Process:
            command = [str(example("talker")), "--ros-args"]
            command += ["-r", "__ns:=/left", "-r", "header:=time", *ros_arguments]
            talkers.append(Process(command, domain, tmp_path / "talker", {}))
            return talkers[-1]

        yield start


def is_known(peer: Peer) -> bool:
    return ("talker", "/left") in peer.node.get_node_names_and_namespaces()


def test_the_node_is_seen_under_its_remapped_names_and_leaves_at_once(
    start_talker: StartTalker, peer: Peer
) -> None:
    talker = start_talker()
    peer.spin_until(lambda: is_known(peer), "the talker in the graph")
    peer.spin_until(lambda: peer.node.count_publishers(TOPIC) == 1, "its topic")
    assert peer.node.count_publishers("/left/header") == 0
    Client(peer, NODE)  # its services are there
    talker.stop()
    peer.spin_until(lambda: peer.node.count_publishers(TOPIC) == 0, "its topic to go")
    peer.spin_until(lambda: not is_known(peer), "the talker to go")
    assert "[left.talker]: leaving" in talker.log


def test_parameters_are_declared_described_set_and_refused(
    start_talker: StartTalker, peer: Peer
) -> None:
    start_talker("-p", "rate_hz:=20")
    client = Client(peer, NODE)
    own = ["frame_id", "rate_hz", "use_sim_time"]
    assert [name for name in client.names() if "." not in name] == own
    assert client.values(own) == ["sensor", 20.0, False]
    frame, rate, _ = client.describe(own)
    assert frame.read_only and not rate.read_only
    assert (rate.type, rate.description) == (ParameterType.PARAMETER_DOUBLE, "Hz, of all headers")
    (bounds,) = rate.floating_point_range
    assert (bounds.from_value, bounds.to_value) == (0.1, 100.0)
    depth = "qos_overrides./left/time.publisher.depth"
    assert client.values([depth]) == [10]

    (result,) = client.set(rate_hz=50.0)
    assert result.successful and client.values(["rate_hz"]) == [50.0]
    refused = client.set(rate_hz=0.0, frame_id="other", rate=1.0)
    for result, reason in zip(refused, ["from 0.1 to 100.0", "read-only", "unknown parameter"], strict=True):
        assert not result.successful and reason in result.reason, result.reason
    assert client.values(["rate_hz"]) == [50.0]


def test_it_publishes_while_it_is_active_and_only_then(
    start_talker: StartTalker, peer: Peer
) -> None:
    start_talker("-p", "rate_hz:=50", "-p", "frame_id:=lidar")
    headers = peer.collect(Header, TOPIC, RELIABLE)
    manager = Manager(peer, NODE)
    peer.spin_until(lambda: peer.node.count_publishers(TOPIC) == 1, "its topic")
    peer.spin_for(0.2)
    assert not headers, "unconfigured"
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE)
    assert manager.state() == "active"
    peer.spin_until(lambda: len(headers) >= 5, "headers")
    assert {header.frame_id for header in headers} == {"lidar"}
    stamps = [header.stamp.sec + 1e-9 * header.stamp.nanosec for header in headers]
    assert stamps == sorted(stamps)

    assert not manager.change(CONFIGURE), "an active node cannot be configured"
    assert manager.change(DEACTIVATE)
    peer.spin_for(0.2)
    count = len(headers)
    peer.spin_for(0.2)
    assert len(headers) == count, "inactive"


def test_a_wrong_argument_ends_it_with_the_reason(start_talker: StartTalker) -> None:
    talker = start_talker("-p", "rate_hz:=fast")
    wait_until(lambda: not talker.running, "the talker to end")
    assert talker.wait() == 1
    assert 'talker: argument -p: parameter "rate_hz" takes a double' in talker.log
