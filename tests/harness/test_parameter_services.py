"""The parameter services as users' tools call them: rclpy's own client, and the services below it."""

import pytest
from rcl_interfaces.msg import (
    Parameter,
    ParameterDescriptor,
    ParameterEvent,
    ParameterType,
    ParameterValue,
    SetParametersResult,
)
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.parameter import Parameter as RclpyParameter
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_parameter_events

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.estimator import Estimator
from harness.peer import Peer
from harness.processes import REPOSITORY

NODE = "/tanker_pose"
# As the file for people marks them.
FIXED = {
    line.split(":")[0].strip()
    for line in (REPOSITORY / "config" / "tanker_pose.yaml").read_text(encoding="utf-8").splitlines()
    if "# (fixed)" in line
}
QOS = "qos_overrides./pose.publisher"


class Client:
    """rclpy's client for the parameters of another node, waiting for each answer."""

    def __init__(self, peer: Peer, node: str = NODE) -> None:
        self._peer = peer
        self._client = AsyncParameterClient(peer.node, node)
        peer.spin_until(self._client.services_are_ready, f"the parameter services of {node}")

    def _answer(self, future, what: str):
        self._peer.spin_until(future.done, what)
        return future.result()

    def names(self, prefixes: list[str] | None = None, depth: int = 0) -> list[str]:
        future = self._client.list_parameters(prefixes, depth)
        return list(self._answer(future, "the list of parameters").result.names)

    def values(self, names: list[str]) -> list[object]:
        future = self._client.get_parameters(names)
        return [parameter_value_to_python(v) for v in self._answer(future, "values").values]

    def types(self, names: list[str]) -> list[int]:
        return list(self._answer(self._client.get_parameter_types(names), "types").types)

    def describe(self, names: list[str]) -> list[ParameterDescriptor]:
        future = self._client.describe_parameters(names)
        return list(self._answer(future, "descriptions").descriptors)

    def set(self, **values: object) -> list[SetParametersResult]:
        future = self._client.set_parameters(assignments(values))
        return list(self._answer(future, "the results of setting").results)

    def set_atomically(self, **values: object) -> SetParametersResult:
        future = self._client.set_parameters_atomically(assignments(values))
        return self._answer(future, "the result of setting").result


def assignments(values: dict[str, object]) -> list[RclpyParameter]:
    return [RclpyParameter(name, value=value) for name, value in values.items()]


@pytest.fixture
def client(start_node: StartNode, peer: Peer) -> Client:
    start_node()
    return Client(peer)


def test_all_parameters_are_described_at_once(client: Client) -> None:
    names = client.names()
    assert FIXED < set(names)

    # As rqt asks: about 6 kB of reply, more than a datagram of the middleware holds.
    descriptors = {descriptor.name: descriptor for descriptor in client.describe(names)}

    assert list(descriptors) == names
    for name, descriptor in descriptors.items():
        assert descriptor.type != ParameterType.PARAMETER_NOT_SET, name
        assert descriptor.description, name
        assert descriptor.read_only == (name in FIXED or name.startswith("qos_overrides.")), name
    assert client.types(names) == [descriptor.type for descriptor in descriptors.values()]
    (sigma_range,) = descriptors["pixel_sigma_px"].floating_point_range
    assert (sigma_range.from_value, sigma_range.to_value) == (0.001, 100.0)
    (outlier_range,) = descriptors["max_outliers"].integer_range
    assert (outlier_range.from_value, outlier_range.to_value) == (0, 2)
    assert "nominal, dlt, previous, global" in descriptors["initialisation"].additional_constraints


def test_prefix_and_depth_limit_the_list(client: Client) -> None:
    pose = sorted(
        f"{QOS}.{policy}"
        for policy in ("deadline", "depth", "durability", "history", "reliability")
    )
    assert client.names([QOS]) == pose
    assert client.names(["qos_overrides"], 1) == []
    assert set(client.names(["qos_overrides"], 3)) > set(pose)
    assert client.names(["min_points", "max_outliers"]) == ["max_outliers", "min_points"]
    top = client.names(depth=1)
    assert "min_points" in top and not any("." in name for name in top)


def test_an_unknown_name_is_answered_in_its_place(client: Client) -> None:
    asked = ["no_such_parameter", "min_points"]
    assert client.values(asked) == [None, 5]
    assert client.types(asked) == [
        ParameterType.PARAMETER_NOT_SET,
        ParameterType.PARAMETER_INTEGER,
    ]
    unknown, known = client.describe(asked)
    assert (unknown.name, unknown.type) == ("no_such_parameter", ParameterType.PARAMETER_NOT_SET)
    assert known.integer_range


def test_each_is_set_by_itself_and_refusals_give_the_reason(client: Client) -> None:
    results = client.set(
        max_outliers=0, min_points=2, marker_map="fin6", no_such_parameter=1, pixel_sigma_px=2
    )

    accepted, out_of_range, fixed, unknown, whole_number = results
    assert accepted.successful and not accepted.reason
    assert not out_of_range.successful
    assert "from 3 to 1000, got 2" in out_of_range.reason
    assert not fixed.successful and "read-only" in fixed.reason
    assert not unknown.successful and "no_such_parameter" in unknown.reason
    assert whole_number.successful, "people write 2 for 2.0"
    names = ["max_outliers", "min_points", "marker_map", "pixel_sigma_px"]
    assert client.values(names) == [0, 5, "paper", 2.0]


def test_an_atomic_set_is_all_or_nothing(client: Client) -> None:
    names = ["max_outliers", "min_points"]

    refused = client.set_atomically(max_outliers=0, min_points=2)
    assert not refused.successful and "min_points" in refused.reason
    assert client.values(names) == [1, 5]

    accepted = client.set_atomically(max_outliers=0, min_points=6)
    assert accepted.successful, accepted.reason
    assert client.values(names) == [0, 6]


def test_a_parameter_cannot_be_unset_or_become_a_list(client: Client, peer: Peer) -> None:
    nothing = ParameterValue(type=ParameterType.PARAMETER_NOT_SET)
    many = ParameterValue(type=ParameterType.PARAMETER_INTEGER_ARRAY, integer_array_value=[1, 2])
    request = SetParameters.Request(
        parameters=[Parameter(name="min_points", value=value) for value in (nothing, many)]
    )

    results = peer.call(SetParameters, f"{NODE}/set_parameters", request).results

    assert all(not result.successful and "min_points" in result.reason for result in results)
    assert client.values(["min_points"]) == [5]


def test_a_change_holds_for_the_next_frame(estimator: Estimator) -> None:
    client = Client(estimator.peer)

    def five(index: int):
        frame = messages.exact_frame(index)
        frame.points = frame.points[:5]
        return frame

    for least, outcome in [(6, "TOO_FEW_POINTS"), (5, "OK"), (6, "TOO_FEW_POINTS")]:
        (result,) = client.set(min_points=least)
        assert result.successful, result.reason
        assert estimator.ask(five(estimator.next_index())).outcome == outcome


def test_changes_are_told_to_all(start_node: StartNode, peer: Peer) -> None:
    start_node()
    events: list[ParameterEvent] = peer.collect(
        ParameterEvent, "/parameter_events", qos_profile_parameter_events
    )
    client = Client(peer)

    def told() -> list[dict[str, object]]:
        """What each event of the node says."""
        return [
            {p.name: parameter_value_to_python(p.value) for p in event.changed_parameters}
            for event in events
            if event.node == NODE
        ]

    def set_until_heard() -> bool:
        # The node may find our subscription a little later than our client.
        client.set(max_ambiguity=0.2)
        return bool(told())

    peer.spin_until(set_until_heard, "the first event")
    peer.spin_until(lambda: {"max_ambiguity": 0.2} in told(), "the first event")

    client.set(min_points=2, max_outliers=2)
    client.set_atomically(min_points=4, max_outliers=7)
    client.set_atomically(min_points=4, marker_map="paper", max_outliers=1)
    expected = [{"max_outliers": 2}, {"min_points": 4, "max_outliers": 1}]
    peer.spin_until(lambda: told()[-1] == expected[-1], "the event of the atomic set")

    assert told()[-2:] == expected, "refused values are not told, nor one that is fixed and stays"
    assert all(not e.new_parameters and not e.deleted_parameters for e in events)


def test_values_written_as_a_tool_dumps_them_can_all_be_set_again(client: Client) -> None:
    names = client.names()
    dumped = dict(zip(names, client.values(names), strict=True))

    results = client.set(**dumped)

    assert [result.reason for result in results if not result.successful] == []


def test_replies_arrive_up_to_what_udp_carries_and_longer_ones_are_empty(
    start_estimator: StartEstimator, peer: Peer
) -> None:
    estimator = start_estimator()
    estimator.use_camera()

    def values(count: int) -> list[ParameterValue]:
        request = GetParameters.Request(names=["initialisation"] * count)
        return peer.call(GetParameters, f"{NODE}/get_parameters", request).values

    # 56 bytes each: within a datagram, around the middleware's own limit, and far above it.
    for count in (1, 17, 18, 23, 30, 1000, 1, 200):
        answered = values(count)
        assert [value.string_value for value in answered] == ["nominal"] * count

    assert values(2000) == []
    assert "ask for fewer parameters" in estimator.process.log
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))


def test_long_replies_reach_the_client_that_asked(start_node: StartNode, peer: Peer) -> None:
    start_node()
    other = Peer(peer.domain, "other")
    try:
        clients = [Client(peer), Client(other), Client(peer)]
        for client in clients * 3:
            names = client.names()
            assert [descriptor.name for descriptor in client.describe(names)] == names
    finally:
        other.close()


def test_a_long_name_is_cut_in_the_reason(client: Client, peer: Peer) -> None:
    value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="x" * 5000)
    parameters = [Parameter(name="initialisation", value=value), Parameter(name="y" * 5000)]
    request = SetParameters.Request(parameters=parameters)

    results = peer.call(SetParameters, f"{NODE}/set_parameters", request).results

    assert all(not result.successful and len(result.reason) < 300 for result in results)
    assert client.values(["initialisation"]) == ["nominal"]


def test_services_belong_to_the_node_in_the_graph(client: Client, peer: Peer) -> None:
    peer.spin_until(lambda: peer.sees_node(NODE), "the node in the graph")

    def services() -> dict[str, list[str]]:
        return dict(peer.node.get_service_names_and_types_by_node("tanker_pose", "/"))

    def own() -> list[str]:
        return [name for name in services() if name.startswith(f"{NODE}/")]

    # Its endpoints are told one after the other.
    # Six for parameters, and reset.
    peer.spin_until(lambda: len(own()) == 7, "seven services of the node")

    assert services()[f"{NODE}/describe_parameters"] == ["rcl_interfaces/srv/DescribeParameters"]
    response = peer.call(
        DescribeParameters, f"{NODE}/describe_parameters", DescribeParameters.Request()
    )
    assert response.descriptors == []
