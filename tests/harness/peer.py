"""A real rclpy node on the other side of the wire, spun by the test itself: no hidden threads."""

import time
from collections.abc import Callable
from typing import Any

import rclpy
import rclpy.node
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from harness.waiting import PATIENCE_S, POLL_S, wait_until

# A slow test machine must never lose a sample in rclpy's own queue.
_DEPTH = 1000

RELIABLE = QoSProfile(
    depth=_DEPTH, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE
)
BEST_EFFORT = QoSProfile(
    depth=_DEPTH, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT
)
LATCHED = QoSProfile(
    depth=_DEPTH,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class Peer:
    """One rclpy context with one node in it."""

    def __init__(self, domain: int, name: str = "harness") -> None:
        self.domain = domain
        self._context = Context()
        # pytest keeps its own Ctrl-C.
        rclpy.init(
            context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        self.node = rclpy.create_node(name, context=self._context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def close(self) -> None:
        """Leaves the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def add_node(self, node: rclpy.node.Node) -> None:
        """Spins another node of this context too."""
        self._executor.add_node(node)

    def remove_node(self, node: rclpy.node.Node) -> None:
        """Spins it no longer."""
        self._executor.remove_node(node)

    def collect(
        self, message_type: type, topic: str, qos: QoSProfile = RELIABLE, *, raw: bool = False
    ) -> list[Any]:
        """A list that grows with every message received while the peer spins."""
        received: list[Any] = []
        self.node.create_subscription(message_type, topic, received.append, qos, raw=raw)
        return received

    def spin_until(
        self, condition: Callable[[], bool], what: str, timeout_s: float = PATIENCE_S
    ) -> None:
        """Handles callbacks until `condition` holds."""
        wait_until(condition, what, timeout_s=timeout_s, pause=self._spin_once)

    def _spin_once(self) -> None:
        self._executor.spin_once(timeout_sec=POLL_S)

    def spin_for(self, duration_s: float) -> None:
        """Handles callbacks for a while, for pacing and for showing that nothing comes."""
        deadline = time.monotonic() + duration_s
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def call(self, service_type: type, name: str, request: Any) -> Any:
        """A service's response."""
        client = self.node.create_client(service_type, name)
        self.spin_until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.spin_until(future.done, f"the response of {name}")
        self.node.destroy_client(client)
        return future.result()

    def send(self, service_type: type, name: str, request: Any) -> None:
        """Asks a service whose response may never come."""
        client = self.node.create_client(service_type, name)
        self.spin_until(client.service_is_ready, f"service {name}")
        client.call_async(request)
        self.spin_for(0.5)

    def sees_node(self, full_name: str) -> bool:
        """Whether the graph holds a node of this name."""
        namespace, _, name = full_name.rpartition("/")
        return (name, namespace or "/") in self.node.get_node_names_and_namespaces()
