"""The command ``tanker_pose``, without ROS: solve, replay, evaluate, check, reproduce."""

import signal
import sys

from . import _native


def main() -> None:
    """Runs the tool of the command line in this process and exits with its code."""
    # Python's own handler would only act after the tool has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.run_tool(["tanker_pose", *sys.argv[1:]]))
