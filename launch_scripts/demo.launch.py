"""The demo: a simulated approach over real DDS, the node's answers, and its error against the truth.

ros2 launch tanker_pose demo.launch.py, or python3 launch_scripts/demo.launch.py; it ends by itself.
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from two_faces import Argument, Launch, Program

ARGUMENTS = [
    Argument("marker_map", "paper", "beacons of the tanker: paper, fin6 or the path of a YAML file"),
    Argument("duration_s", "25", "how long the approach takes, s"),
    Argument("rate_hz", "30", "images a second"),
    Argument("sigma_px", "0.5", "noise of the simulated detector, px"),
    Argument("seed", "1", "of noise, motion and faults"),
]


def programs(values: Mapping[str, str]) -> Iterator[Program]:
    options = [f"--{name.replace('_', '-')}={value}" for name, value in values.items()]
    # The node is a thread of the demo, which has no ROS arguments of its own.
    yield Program("tanker_pose", words=["demo", *options], takes_ros_arguments=False)


LAUNCH = Launch(__doc__, ARGUMENTS, programs)
generate_launch_description = LAUNCH.description

if __name__ == "__main__":
    sys.exit(LAUNCH.main())
