"""What every test is handed: a ROS domain of its own, an rclpy peer, and ways to start the node."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

# Before numpy is imported: on two cores, threads that spin for work hold up the nodes under test.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
# Before rclpy is imported, for it is read once: nothing leaves this host or comes in from outside.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
_FOREIGN = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS", "RUST_LOG")
for _variable in _FOREIGN:
    os.environ.pop(_variable, None)

# A shell's background job ignores SIGINT, and what it starts inherits that; what is started here is to get it as from a
# terminal.
signal.signal(signal.SIGINT, signal.default_int_handler)

# A request to a service that was discovered a moment ago would else be repeated after 3 s.
os.environ["FASTDDS_DEFAULT_PROFILES_FILE"] = str(
    Path(__file__).parent / "fixtures" / "fastdds_fast_heartbeat.xml"
)
os.environ["RMW_FASTRTPS_USE_QOS_FROM_XML"] = "1"

import numpy as np  # noqa: E402

from harness.domains import claimed_domain  # noqa: E402
from harness.estimator import FEATURE_POINTS, Estimator, Topics  # noqa: E402
from harness.peer import BEST_EFFORT, Peer  # noqa: E402
from harness.processes import Process, binary, started  # noqa: E402

StartNode = Callable[..., Process]
StartEstimator = Callable[..., Estimator]


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain that no other test uses at the same time."""
    with claimed_domain() as claimed:
        yield claimed


@pytest.fixture
def peer(domain: int) -> Iterator[Peer]:
    """An rclpy node in the test's domain."""
    peer = Peer(domain)
    yield peer
    peer.close()


@pytest.fixture
def start_node(domain: int, tmp_path: Path) -> Iterator[StartNode]:
    """Starts the node with ROS arguments; in the end all that still run must leave with code 0."""
    with started() as nodes:

        def start(*ros_arguments: str, environment: dict[str, str] | None = None) -> Process:
            command = [str(binary("tanker_pose_node"))]
            if ros_arguments:
                command += ["--ros-args", *ros_arguments]
            directory = tmp_path / f"node_{len(nodes)}"
            nodes.append(Process(command, domain, directory, environment or {}))
            return nodes[-1]

        yield start


@pytest.fixture
def start_estimator(start_node: StartNode, peer: Peer) -> StartEstimator:
    """Starts the node, wires the peer to it and waits until they hear each other."""

    def start(
        *ros_arguments: str, topics: Topics = Topics(), qos=BEST_EFFORT, detector=FEATURE_POINTS
    ) -> Estimator:
        estimator = Estimator(peer, start_node(*ros_arguments), topics, qos, detector)
        estimator.wait_until_heard()
        return estimator

    return start


@pytest.fixture
def estimator(start_estimator: StartEstimator) -> Estimator:
    """The node with its defaults and the paper's camera."""
    estimator = start_estimator()
    estimator.use_camera()
    return estimator


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers, the same on every run and different for every test."""
    return np.random.default_rng(list(request.node.name.encode()))
