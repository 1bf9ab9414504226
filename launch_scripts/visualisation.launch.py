"""The node with its markers, and RViz to see them where that is installed.

ros2 launch tanker_pose visualisation.launch.py camera_frame:=nose_camera receiver_frame:=base_link
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from two_faces import BOOLEAN, SHARE, Argument, Launch, Program, given, text

RVIZ = str(SHARE / "config" / "rviz" / "tanker_pose.rviz")
# The optical frame of a camera that looks straight ahead, upright, in a frame with x forward, y left, z up.
LOOKING_AHEAD = ["--roll", "-1.5707963267948966", "--yaw", "-1.5707963267948966"]

ARGUMENTS = [
    Argument("namespace", "", "of the node"),
    Argument("params_file", str(SHARE / "config" / "tanker_pose.yaml"), "parameters of the node"),
    Argument("marker_map", "", "beacons of the tanker; empty: as in params_file"),
    Argument("camera_frame", "camera", "frame_id of the detections, RViz's fixed frame"),
    Argument(
        "receiver_frame",
        "",
        "if given, where a camera that looks straight ahead sits; for another mount, publish your own transform",
    ),
    Argument("publish_tf", "true", "publish trusted poses to /tf too", BOOLEAN),
    Argument("rviz", "true", "open RViz", BOOLEAN),
]


def programs(values: Mapping[str, str]) -> Iterator[Program]:
    namespace = values["namespace"].strip("/")
    prefix = f"/{namespace}" if namespace else ""
    yield Program(
        "tanker_pose_node",
        namespace=namespace,
        parameter_files=[values["params_file"]],
        parameters={"publish_markers": "true", "publish_tf": values["publish_tf"]}
        | given(marker_map=text(values["marker_map"]) if values["marker_map"] else ""),
    )
    if values["receiver_frame"]:
        frames = ["--frame-id", values["receiver_frame"], "--child-frame-id", values["camera_frame"]]
        words = [*LOOKING_AHEAD, *frames]
        yield Program(
            "static_transform_publisher",
            package="tf2_ros",
            words=words,
            name="camera_mount",
            instead=f"tf2_ros is not installed; elsewhere run: ros2 run tf2_ros static_transform_publisher {' '.join(words)}",
        )
    if values["rviz"] == "true":
        yield Program(
            "rviz2",
            package="rviz2",
            words=["-d", RVIZ, "-f", values["camera_frame"]],
            remaps={topic: prefix + topic for topic in ("/pose", "/markers")} if prefix else {},
            instead=f"rviz2 is not installed; elsewhere run: rviz2 -d {RVIZ} -f {values['camera_frame']}",
        )


LAUNCH = Launch(__doc__, ARGUMENTS, programs)
generate_launch_description = LAUNCH.description

if __name__ == "__main__":
    sys.exit(LAUNCH.main())
