"""Simulated time: the node follows a real /clock publisher while use_sim_time is set."""

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import qos_profile_parameter_events
from rosgraph_msgs.msg import Clock

from harness import messages
from harness.conftest import StartEstimator
from harness.estimator import Estimator
from harness.messages import key
from harness.peer import BEST_EFFORT, Peer
from harness.test_parameter_services import NODE, Client

# The simulation began here, s; no real clock shows it.
SIMULATED_S = 1000


class Simulator:
    """Publishes /clock as simulators do, and hears what the node stamps."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.publisher = peer.node.create_publisher(Clock, "/clock", BEST_EFFORT)
        self.reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
        self.events: list[ParameterEvent] = peer.collect(
            ParameterEvent, "/parameter_events", qos_profile_parameter_events
        )

    def show(self, sec: int, nanosec: int = 0) -> None:
        self.publisher.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))
        self.peer.spin_for(0.05)

    def show_until_reported(self, sec: int, nanosec: int = 0) -> None:
        """Keeps the simulation at a time until the node reports at it."""

        def reported() -> bool:
            self.show(sec, nanosec)
            return any(key(r.header.stamp) == (sec, nanosec) for r in self.reports)

        self.peer.spin_until(reported, f"a report at {sec}.{nanosec:09}")

    def last_event(self) -> tuple[int, int]:
        return key([event for event in self.events if event.node == NODE][-1].stamp)

    def set_and_hear(self, client: Client, **values: object) -> tuple[int, int]:
        """The stamp of the event of a change."""
        before = len(self.events)
        (result,) = client.set(**values)
        assert result.successful, result.reason
        self.peer.spin_until(lambda: len(self.events) > before, "the event of the change")
        return self.last_event()


def listeners(peer: Peer) -> int:
    """The node's subscriptions to /clock with the type that simulators publish."""
    infos = peer.node.get_subscriptions_info_by_topic("/clock")
    return sum(info.topic_type == "rosgraph_msgs/msg/Clock" for info in infos)


def test_the_node_starts_at_zero_and_follows_the_simulated_clock(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    simulator = Simulator(peer)
    start_estimator("-p", "use_sim_time:=true")
    client = Client(peer)

    peer.spin_until(lambda: len(simulator.reports) > 0, "a report")
    assert key(simulator.reports[-1].header.stamp) == (0, 0), "no clock has been shown"

    simulator.show_until_reported(SIMULATED_S, 500_000_000)
    assert simulator.set_and_hear(client, max_ambiguity=0.2) == (SIMULATED_S, 500_000_000)
    # Also backwards: a simulation or a bag that begins again.
    simulator.show_until_reported(SIMULATED_S - 100)
    assert simulator.set_and_hear(client, max_ambiguity=0.3) == (SIMULATED_S - 100, 0)


def test_simulated_time_begins_and_ends_while_the_node_runs(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    simulator = Simulator(peer)
    process = start_estimator().process
    client = Client(peer)
    peer.spin_until(lambda: len(simulator.reports) > 0, "a report")
    real_s = simulator.reports[-1].header.stamp.sec
    assert real_s > 1_000_000_000
    assert listeners(peer) == 0

    for _ in range(2):
        (result,) = client.set(use_sim_time=True)
        assert result.successful, result.reason
        simulator.show_until_reported(SIMULATED_S)
        assert listeners(peer) == 1
        assert simulator.set_and_hear(client, min_points=5) == (SIMULATED_S, 0)

        (result,) = client.set(use_sim_time=False)
        assert result.successful, result.reason
        seen = len(simulator.reports)
        peer.spin_until(
            lambda seen=seen: any(r.header.stamp.sec >= real_s for r in simulator.reports[seen:]),
            "a report in real time",
        )
        assert simulator.set_and_hear(client, min_points=5)[0] >= real_s
        simulator.reports.clear()
    assert "[ERROR]" not in process.log, process.log


def test_poses_and_parameters_work_without_a_clock_and_keep_their_own_stamps(
    start_estimator: StartEstimator,
) -> None:
    estimator: Estimator = start_estimator("-p", "use_sim_time:=true")
    estimator.use_camera()
    client = Client(estimator.peer)

    frame = messages.exact_frame(estimator.next_index())
    answer = estimator.expect_pose(frame)

    assert answer.pose is not None
    assert key(answer.pose.header.stamp) == key(frame.header.stamp)
    assert key(answer.status.header.stamp) == key(frame.header.stamp)
    (result,) = client.set(min_points=6)
    assert result.successful, result.reason
    five = messages.exact_frame(estimator.next_index())
    five.points = five.points[:5]
    estimator.expect_refusal(five, "TOO_FEW_POINTS")
