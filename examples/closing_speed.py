#!/usr/bin/env python3
"""Prints how far the receptacle is before the probe tip, and how fast it comes nearer.

    python3 examples/closing_speed.py        # until Ctrl-C
    python3 examples/closing_speed.py 10     # ten messages

Needs rclpy and the messages of tanker_pose (a sourced workspace, or `.venv` of `tests/setup`); the node needs
`-p publish_receptacle:=true -p refuelling:=config/refuelling/example.yaml`.
"""

import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.utilities import remove_ros_args
from tanker_pose.msg import ReceptacleState


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


def main() -> None:
    own = remove_ros_args(sys.argv)[1:]
    left = int(own[0]) if own else None
    rclpy.init(args=sys.argv)
    node = rclpy.create_node("closing_speed")

    def show(message: ReceptacleState) -> None:
        nonlocal left
        if left == 0:
            return
        print(line(message), flush=True)
        if left is not None:
            left -= 1

    node.create_subscription(ReceptacleState, "receptacle", show, 10)
    try:
        while left != 0:
            rclpy.spin_once(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
