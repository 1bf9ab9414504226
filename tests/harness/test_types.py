"""One definition of every message: msg/, the built bindings and the bag reader agree to the bit."""

import json
import sys
from pathlib import Path

import apriltag_msgs.msg
import pytest
import tanker_pose.msg
import tf2_msgs.msg
import vision_msgs.msg
from rosbags.typesys import Stores, get_typestore

from harness.processes import REPOSITORY
from harness.typestore import typestore

OURS = sorted(path.stem for path in (REPOSITORY / "msg").glob("*.msg"))


def built_hash(package: str, name: str) -> str:
    """The type hash in the description that rosidl installed with the bindings."""
    path = Path(sys.prefix) / "share" / package / "msg" / f"{name}.json"
    description = json.loads(path.read_text(encoding="utf-8"))
    (entry,) = [
        entry
        for entry in description["type_hashes"]
        if entry["type_name"] == f"{package}/msg/{name}"
    ]
    return entry["hash_string"]


def test_the_contract_has_three_messages() -> None:
    assert OURS == ["EstimatorStatus", "FeaturePoint", "FeaturePointArray"]


@pytest.mark.parametrize("name", OURS)
def test_built_bindings_have_the_hash_of_the_message_text(name: str) -> None:
    assert hasattr(tanker_pose.msg, name)
    assert built_hash("tanker_pose", name) == typestore().hash_rihs01(f"tanker_pose/msg/{name}")


def test_the_tf_definition_in_our_fixtures_is_that_of_ros() -> None:
    assert hasattr(tf2_msgs.msg, "TFMessage")
    expected = get_typestore(Stores.ROS2_JAZZY).hash_rihs01("tf2_msgs/msg/TFMessage")
    assert built_hash("tf2_msgs", "TFMessage") == expected


# As in the packages of ROS 2, read from C code that rosidl generated from vision_msgs 4.1 and apriltag_msgs 2.0.
RELEASED = {
    "vision_msgs/msg/Detection2DArray": (
        "RIHS01_214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968"
    ),
    "apriltag_msgs/msg/AprilTagDetectionArray": (
        "RIHS01_6016bfe513a7c741ccbdbc6419ed6c4cabfe5f11271a96555fbf26565c6b9826"
    ),
}


@pytest.mark.parametrize("bindings", [vision_msgs.msg, apriltag_msgs.msg])
def test_the_definitions_of_detectors_in_our_fixtures_are_those_released(bindings) -> None:
    package = bindings.__name__.removesuffix(".msg")
    (full_name,) = [name for name in RELEASED if name.startswith(package)]
    name = full_name.rpartition("/")[2]

    assert hasattr(bindings, name)
    assert built_hash(package, name) == RELEASED[full_name]
