"""The node beside a camera driver and a detector, with their topics, and image_proc if they need it.

ros2 launch tanker_pose camera.launch.py namespace:=receiver camera:=nose_camera marker_map:=my_tanker.yaml
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from two_faces import BOOLEAN, SHARE, Argument, Launch, Program, given, text

ARGUMENTS = [
    Argument("namespace", "", "of the node; topics below are relative to it"),
    Argument("name", "tanker_pose", "of the node"),
    Argument("camera", "camera", "namespace of the camera driver: its camera_info is listened to"),
    Argument("detections", "detector/points", "topic of the detector"),
    Argument(
        "input",
        "feature_points",
        "what the detector publishes",
        ("feature_points", "detections", "apriltags"),
    ),
    Argument("params_file", str(SHARE / "config" / "tanker_pose.yaml"), "parameters of the node"),
    Argument("marker_map", "", "beacons of the tanker; empty: as in params_file"),
    Argument(
        "rectify",
        "false",
        "start image_proc in the camera's namespace, image_raw to image_rect, and take detections to come from there",
        BOOLEAN,
    ),
]


def programs(values: Mapping[str, str]) -> Iterator[Program]:
    parameters = {"input": values["input"]} | given(
        marker_map=text(values["marker_map"]) if values["marker_map"] else "",
        rectified="true" if values["rectify"] == "true" else "",
    )
    topic = "feature_points" if values["input"] == "feature_points" else "detections"
    yield Program(
        "tanker_pose_node",
        name=values["name"],
        namespace=values["namespace"],
        parameter_files=[values["params_file"]],
        parameters=parameters,
        remaps={"camera_info": f"{values['camera']}/camera_info", topic: values["detections"]},
    )
    if values["rectify"] == "true":
        absolute = values["camera"].startswith("/")
        yield Program(
            "rectify_node",
            package="image_proc",
            namespace=values["camera"] if absolute else f"{values['namespace']}/{values['camera']}",
            remaps={"image": "image_raw"},
        )


LAUNCH = Launch(__doc__, ARGUMENTS, programs)
generate_launch_description = LAUNCH.description

if __name__ == "__main__":
    sys.exit(LAUNCH.main())
