"""A simulated approach with the node that estimates it; ends with the approach.

ros2 launch tanker_pose simulation.launch.py loop:=true gross_error_every:=30
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from two_faces import BOOLEAN, SHARE, Argument, Launch, Program, text

OPTIONS = [
    Argument("start_range_m", "60", "distance ahead at the start, m"),
    Argument("end_range_m", "15", "distance ahead at the end, m"),
    Argument("duration_s", "25", "how long the approach takes, s"),
    Argument("rate_hz", "30", "images a second"),
    Argument("sigma_px", "0.5", "noise of the simulated detector, px"),
    Argument("seed", "1", "of noise, motion and faults"),
    Argument("gross_error_every", "0", "every so many frames one detection is wrong; 0: never"),
]
ARGUMENTS = [
    Argument("namespace", "", "of simulation and node"),
    Argument("params_file", str(SHARE / "config" / "tanker_pose.yaml"), "parameters of the node"),
    Argument("marker_map", "paper", "beacons of the tanker: paper, fin6 or the path of a YAML file"),
    Argument("loop", "false", "start the approach again at its end", BOOLEAN),
    *OPTIONS,
]


def programs(values: Mapping[str, str]) -> Iterator[Program]:
    marker_map = values["marker_map"]
    yield Program(
        "tanker_pose_node",
        namespace=values["namespace"],
        parameter_files=[values["params_file"]],
        parameters={"marker_map": text(marker_map)},
    )
    options = [f"--{option.name.replace('_', '-')}={values[option.name]}" for option in OPTIONS]
    loop = ["--loop"] if values["loop"] == "true" else []
    yield Program(
        "tanker_pose",
        words=["simulate", f"--marker-map={marker_map}", *options, *loop],
        namespace=values["namespace"],
    )


LAUNCH = Launch(__doc__, ARGUMENTS, programs)
generate_launch_description = LAUNCH.description

if __name__ == "__main__":
    sys.exit(LAUNCH.main())
