"""A managed node (`lifecycle:=true`) beside rclpy's own, which is rcl's and so rclcpp's state machine."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State, Transition, TransitionDescription, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.parameter import Parameter as RclpyParameter
from rclpy.parameter_client import AsyncParameterClient
from tanker_pose.msg import ReceptacleState
from visualization_msgs.msg import MarkerArray

from harness import messages, paper
from harness.approach import CAMERA_IN_RECEIVER, RECEPTACLE_IN_TANKER, SETUP
from harness.conftest import StartNode
from harness.estimator import Estimator
from harness.messages import key
from harness.peer import Peer
from harness.rotations import Array, about_y
from harness.waiting import wait_until

RCLError = rclpy_implementation.RCLError

MANAGED = ("-p", "lifecycle:=true")
SERVICES = {
    "change_state": "lifecycle_msgs/srv/ChangeState",
    "get_state": "lifecycle_msgs/srv/GetState",
    "get_available_states": "lifecycle_msgs/srv/GetAvailableStates",
    "get_available_transitions": "lifecycle_msgs/srv/GetAvailableTransitions",
    "get_transition_graph": "lifecycle_msgs/srv/GetAvailableTransitions",
}
# Enough frames for one to come through, were the node to answer.
SILENT_FRAMES = 10
CONFIGURE = Transition.TRANSITION_CONFIGURE
CLEANUP = Transition.TRANSITION_CLEANUP
ACTIVATE = Transition.TRANSITION_ACTIVATE
DEACTIVATE = Transition.TRANSITION_DEACTIVATE


class Manager:
    """Calls a managed node's services, as Nav2's lifecycle_manager and `ros2 lifecycle` do."""

    def __init__(self, peer: Peer, node: str = "/tanker_pose") -> None:
        self.peer = peer
        self.node = node
        self.events: list[TransitionEvent] = peer.collect(
            TransitionEvent, f"{node}/transition_event", 10
        )
        # Its events must find us from the first one on.
        topic = f"{node}/transition_event"
        peer.spin_until(lambda: peer.node.count_publishers(topic) == 1, "the events' publisher")
        assert self.state() == "unconfigured"

    def change(self, transition: int = 0, label: str = "") -> bool:
        request = ChangeState.Request(transition=Transition(id=transition, label=label))
        try:
            return self.peer.call(ChangeState, f"{self.node}/change_state", request).success
        except RCLError:
            # Jazzy's rclpy raises in its own node where Kilted's answers that there is no such transition.
            return False

    def state(self) -> str:
        response = self.peer.call(GetState, f"{self.node}/get_state", GetState.Request())
        return response.current_state.label

    def states(self) -> list[State]:
        request = GetAvailableStates.Request()
        name = f"{self.node}/get_available_states"
        return list(self.peer.call(GetAvailableStates, name, request).available_states)

    def transitions(self, service: str = "get_available_transitions") -> list[TransitionDescription]:
        request = GetAvailableTransitions.Request()
        name = f"{self.node}/{service}"
        return list(self.peer.call(GetAvailableTransitions, name, request).available_transitions)

    def steps(self) -> list[tuple[State, State]]:
        return [(event.start_state, event.goal_state) for event in self.events]


class Model(LifecycleNode):
    """rclpy's managed node, which can configure itself or not."""

    result = TransitionCallbackReturn.SUCCESS

    def on_configure(self, state) -> TransitionCallbackReturn:
        return self.result

    def on_error(self, state) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.SUCCESS


@pytest.fixture
def model(peer: Peer) -> Iterator[Model]:
    node = Model("model", context=peer.node.context, enable_rosout=False)
    peer.add_node(node)
    yield node
    peer.remove_node(node)
    node.destroy_node()


def spoilt_map(directory: Path) -> Path:
    path = directory / "map.yaml"
    path.write_text("name: spoilt\nmarkers:\n  - {id: 1, x: 1.0}\n", encoding="utf-8")
    return path


def test_services_states_and_transitions_are_those_of_rclpys_managed_node(
    start_node: StartNode, peer: Peer, model: Model
) -> None:
    start_node(*MANAGED)
    ours, theirs = Manager(peer), Manager(peer, "/model")

    def services(node: str) -> dict[str, str]:
        # Endpoints can be known before the name of their node is.
        if not peer.sees_node(f"/{node}"):
            return {}
        found = peer.node.get_service_names_and_types_by_node(node, "/")
        return {name.rpartition("/")[2]: kinds[0] for name, kinds in found}

    wait_until(lambda: SERVICES.items() <= services("tanker_pose").items(), "the services")
    assert SERVICES.items() <= services("model").items()
    assert ours.states() == theirs.states()
    graph = ours.transitions("get_transition_graph")
    assert graph == theirs.transitions("get_transition_graph")
    assert len(graph) == 25

    def event_endpoint(node: str) -> tuple[object, ...]:
        (info,) = peer.node.get_publishers_info_by_topic(f"{node}/transition_event")
        return info.topic_type, info.qos_profile.reliability, info.qos_profile.durability

    assert event_endpoint("/tanker_pose") == event_endpoint("/model")


def test_every_request_has_the_effect_that_it_has_on_rclpys_managed_node(
    start_node: StartNode, peer: Peer, model: Model
) -> None:
    start_node(*MANAGED)
    ours, theirs = Manager(peer), Manager(peer, "/model")
    requests: list[tuple[int, str]] = [
        (ACTIVATE, ""),
        (CONFIGURE, ""),
        (CONFIGURE, ""),
        (ACTIVATE, ""),
        (CLEANUP, ""),
        (Transition.TRANSITION_INACTIVE_SHUTDOWN, ""),
        (DEACTIVATE, ""),
        (0, "cleanup"),
        (99, "configure"),
        (ACTIVATE, "no such word"),
        (0, "activate"),
        (0, "shutdown"),
        (CONFIGURE, ""),
    ]

    for request in requests:
        assert ours.change(*request) == theirs.change(*request), request
        assert ours.state() == theirs.state(), request
        assert ours.transitions() == theirs.transitions(), request

    assert ours.state() == "finalized"
    peer.spin_until(lambda: len(ours.events) >= len(theirs.events), "the events")
    assert ours.steps() == theirs.steps()
    for event in ours.events:
        description = (event.transition, event.start_state, event.goal_state)
        assert description in [
            (known.transition, known.start_state, known.goal_state)
            for known in ours.transitions("get_transition_graph")
        ]


def test_a_spoilt_map_leaves_the_node_unconfigured_until_it_is_mended(
    start_node: StartNode, peer: Peer, model: Model, tmp_path: Path
) -> None:
    path = spoilt_map(tmp_path)
    node = start_node(*MANAGED, "-p", f"marker_map:={path}")
    ours, theirs = Manager(peer), Manager(peer, "/model")
    model.result = TransitionCallbackReturn.FAILURE

    for _ in range(2):
        assert ours.change(CONFIGURE) == theirs.change(CONFIGURE) is False
        assert ours.state() == theirs.state() == "unconfigured"
    peer.spin_until(lambda: len(ours.events) == len(theirs.events), "the events")
    assert ours.steps() == theirs.steps()
    assert "configuration failed" in node.log and str(path) in node.log

    path.unlink()
    assert not ours.change(CONFIGURE)
    markers = (f"  - {{id: {i}, x: {i}, y: {i * i}, z: {i % 2}}}\n" for i in range(6))
    path.write_text("name: mended\nmarkers:\n" + "".join(markers), encoding="utf-8")
    assert ours.change(CONFIGURE), node.log
    assert ours.state() == "inactive"


def test_topics_open_when_configured_and_answers_come_only_while_active(
    start_node: StartNode, peer: Peer
) -> None:
    node = start_node(*MANAGED, "-p", "publish_markers:=true")
    drawn: list[MarkerArray] = peer.collect(MarkerArray, "/markers")
    reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
    manager = Manager(peer)
    assert peer.node.count_publishers("/pose") == peer.node.count_publishers("/status") == 0
    estimator = Estimator(peer, node)

    def expect_silence() -> None:
        frames = [messages.exact_frame(estimator.next_index()) for _ in range(SILENT_FRAMES)]
        count = len(drawn)
        for frame in frames:
            estimator.send(frame)
            estimator.info_publisher.publish(messages.camera_info())
            peer.spin_for(0.05)
        assert not {key(frame.header.stamp) for frame in frames} & estimator.statuses.keys()
        assert len(drawn) == count

    expect_silence()
    assert manager.change(CONFIGURE), node.log
    published = lambda: peer.node.count_publishers("/status") == 1  # noqa: E731
    peer.spin_until(published, "the open topics")
    peer.spin_until(lambda: estimator.points_publisher.get_subscription_count() == 1, "a match")
    expect_silence()

    def unanswered() -> int:
        values = {pair.key: pair.value for pair in reports[-1].status[0].values} if reports else {}
        return int(values.get("unanswered", 0))

    peer.spin_until(lambda: unanswered() > 0, "a report of frames that came while inactive")

    assert manager.change(ACTIVATE)
    estimator.wait_until_heard()
    # The camera info that came while the node was inactive counts.
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    peer.spin_until(lambda: len(drawn) > 0, "markers")

    assert manager.change(DEACTIVATE)
    peer.spin_for(0.2)
    expect_silence()
    assert manager.change(ACTIVATE)
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    assert manager.change(DEACTIVATE) and manager.change(CLEANUP)
    expect_silence()
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE)
    frame = messages.exact_frame(estimator.next_index())
    assert estimator.ask(frame).outcome == "NO_CAMERA_INFO", "cleaned up, it knows no camera"
    estimator.use_camera()
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    assert manager.change(label="shutdown")
    assert manager.state() == "finalized"
    expect_silence()


def receptacle_from(probe_tip: Array, mount_pitch_deg: float = 0.0) -> Array:
    """Where the receptacle of the paper's pose is before a probe tip."""
    in_camera = paper.POSE.transform(RECEPTACLE_IN_TANKER[None, :])[0]
    mount = about_y(np.radians(mount_pitch_deg))
    in_receiver = mount @ paper.CAMERA_FROM_RECEIVER.T @ in_camera + CAMERA_IN_RECEIVER
    return in_receiver - probe_tip


def test_what_is_configured_again_follows_the_setups_file_and_the_mount_of_now(
    start_node: StartNode, peer: Peer, tmp_path: Path
) -> None:
    setup = tmp_path / "setup.yaml"
    text = SETUP.read_text(encoding="utf-8")
    setup.write_text(text.replace("x: 5.0", "x: much"), encoding="utf-8")
    node = start_node(
        *MANAGED, "-p", f"refuelling:={setup}", "-p", "publish_receptacle:=true"
    )
    told: list[ReceptacleState] = peer.collect(ReceptacleState, "/receptacle")
    reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
    manager = Manager(peer)
    estimator = Estimator(peer, node)
    parameters = AsyncParameterClient(peer.node, "/tanker_pose")
    peer.spin_until(parameters.services_are_ready, "the parameter services")

    def set_pitch(pitch_deg: float) -> None:
        change = RclpyParameter("camera_mount_pitch_deg", value=pitch_deg)
        future = parameters.set_parameters([change])
        peer.spin_until(future.done, "the mount to be set")
        assert future.result().results[0].successful

    def expect(truth: Array) -> None:
        estimator.wait_until_heard()
        estimator.use_camera()
        before = len(told)

        def ask() -> None:
            estimator.expect_pose(messages.exact_frame(estimator.next_index()))
            peer.spin_for(0.05)

        wait_until(lambda: len(told) > before, "a receptacle", pause=ask)
        position = told[-1].position
        # m; exact pixels, so only rounding is left.
        assert np.allclose([position.x, position.y, position.z], truth, atol=1e-4)

    assert not manager.change(CONFIGURE)
    assert "configuration failed" in node.log and str(setup) in node.log
    setup.write_text(text, encoding="utf-8")
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE), node.log
    expect(receptacle_from(np.array([5.0, -0.5, 1.0])))

    # While it is unconfigured.
    assert manager.change(DEACTIVATE) and manager.change(CLEANUP)
    setup.write_text(text.replace("{x: 5.0, y: -0.5,", "{x: 3.0, y: 0.25,"), encoding="utf-8")
    set_pitch(4.0)
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE), node.log
    expect(receptacle_from(np.array([3.0, 0.25, 1.0]), 4.0))

    def published() -> int:
        values = {
            pair.key: pair.value
            for status in (reports[-1].status if reports else [])
            for pair in status.values
        }
        return int(values.get("receptacle.published", len(told)))

    peer.spin_until(lambda: published() < len(told), "counts that began anew")

    # While it is inactive.
    assert manager.change(DEACTIVATE)
    set_pitch(-4.0)
    assert manager.change(ACTIVATE)
    expect(receptacle_from(np.array([3.0, 0.25, 1.0]), -4.0))


@pytest.mark.parametrize("last", [None, CONFIGURE, ACTIVATE], ids=["unconfigured", "inactive", "active"])
def test_a_signal_ends_a_managed_node_in_every_state(
    start_node: StartNode, peer: Peer, last: int | None
) -> None:
    node = start_node(*MANAGED)
    manager = Manager(peer)
    for transition in (CONFIGURE, ACTIVATE):
        if last is not None and transition <= last:
            assert manager.change(transition)

    node.stop()

    peer.spin_until(lambda: not peer.sees_node("/tanker_pose"), "the node to leave", 1.0)
    assert "panicked" not in node.log and "[ERROR]" not in node.log, node.log


def test_an_unmanaged_node_has_no_such_services(start_node: StartNode, peer: Peer) -> None:
    start_node()
    wait_until(lambda: peer.node.count_publishers("/status") == 1, "the open topics")
    peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node in the graph")
    services = lambda: dict(  # noqa: E731
        peer.node.get_service_names_and_types_by_node("tanker_pose", "/")
    )
    wait_until(lambda: "/tanker_pose/set_parameters_atomically" in services(), "its services")
    assert not [name for name in services() if name.rpartition("/")[2] in SERVICES]
