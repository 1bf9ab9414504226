#!/usr/bin/env python3
"""Prints how far the receptacle is before the probe tip, and how fast it comes nearer.

    python3 examples/closing_speed.py        # until Ctrl-C
    python3 examples/closing_speed.py 10     # ten messages

Needs rclpy and the messages of tanker_pose (a sourced workspace, or `.venv` of `tests/setup`); the node needs
`-p publish_receptacle:=true -p refuelling:=config/refuelling/example.yaml`: while nothing comes, what is missing is
said on standard error.
"""

import sys
import time

import rclpy
from rclpy.utilities import remove_ros_args
from rclpy.node import Node
from tanker_pose.msg import ReceptacleState

# So long without a message something is missing, s.
PATIENCE_S = 5.0
TOPIC = "receptacle"

ENVELOPE = {
    ReceptacleState.ENVELOPE_OUTSIDE: "outside",
    ReceptacleState.ENVELOPE_PRE_CONTACT: "pre-contact",
    ReceptacleState.ENVELOPE_CONTACT: "contact window",
}


def line(message: ReceptacleState) -> str:
    """What a message says, for people."""
    return (
        f"distance {message.distance:7.3f} m  closing {message.closing_speed:+7.3f} m/s "
        f"±{message.closing_speed_sigma:.3f}  {ENVELOPE.get(message.envelope, '?')} "
        f"(contact {100 * message.probability_contact:.1f} %)"
    )


def missing(node: Node) -> str:
    """Why nothing comes, as far as the graph shows it."""
    if node.count_publishers(TOPIC):
        why = "it has a publisher, so the node has no confirmed track: `tanker_pose watch` says why"
    elif any(
        "tanker_pose/msg/EstimatorStatus" in types for _, types in node.get_topic_names_and_types()
    ):
        why = (
            "a tanker_pose node is there, but does not publish it. Start the node with -p publish_receptacle:=true "
            "-p refuelling:=config/refuelling/example.yaml, or remap the topic"
        )
    else:
        why = f"no tanker_pose node is in domain {node.context.get_domain_id()}"
    return f"nothing on {node.resolve_topic_name(TOPIC)}: {why}"


def follow(left: int | None) -> None:
    """Prints `left` messages, or all until rclpy is shut down."""
    node = rclpy.create_node("closing_speed")
    said_or_heard = time.monotonic()

    def show(message: ReceptacleState) -> None:
        nonlocal left, said_or_heard
        if left == 0:
            return
        print(line(message), flush=True)
        said_or_heard = time.monotonic()
        if left is not None:
            left -= 1

    node.create_subscription(ReceptacleState, TOPIC, show, 10)
    while left != 0 and rclpy.ok():
        rclpy.spin_once(node, timeout_sec=1.0)
        if left != 0 and time.monotonic() - said_or_heard > PATIENCE_S:
            print(missing(node), file=sys.stderr, flush=True)
            said_or_heard = time.monotonic()
    node.destroy_node()
    rclpy.try_shutdown()


def main() -> None:
    own = remove_ros_args(sys.argv)[1:]
    try:
        rclpy.init(args=sys.argv)
        try:
            follow(int(own[0]) if own else None)
        except Exception:  # Ctrl-C shuts rclpy down, which may fail whatever call is under way
            if rclpy.ok():
                raise
    except KeyboardInterrupt:
        pass  # Ctrl-C


if __name__ == "__main__":
    main()
