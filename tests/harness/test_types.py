"""One definition of every message: msg/, the built bindings and the bag reader agree to the bit."""

import json
import sys
from pathlib import Path

import apriltag_msgs.msg
import px4_msgs.msg
import pytest
import tanker_pose.msg
import tf2_msgs.msg
import vision_msgs.msg
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

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


def test_the_contract_has_six_messages() -> None:
    assert OURS == [
        "EstimatorStatus",
        "FeaturePoint",
        "FeaturePointArray",
        "Integrity",
        "IntegrityPoint",
        "ReceptacleState",
    ]


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


# As in px4_msgs of PX4 1.17, read from C code that rosidl generated; VehicleAttitude is that of 1.14 and later.
FLIGHT_STACKS = {
    "FiducialMarkerPosReport": (
        "RIHS01_eef4e25987707a585d07effb6c4c7211ac7929242ce79be395832e83aa599206"
    ),
    "LandingTargetPose": "RIHS01_591546a7f5429d64febc6ed8fe478544aa4b2f537fb6b91f7bda35cbc82eec17",
    "VehicleAttitude": "RIHS01_9af74ac6c01335f3a8612e3579d4eaa89a9d81550d933ed057f5d6252dc7e50c",
}


@pytest.mark.parametrize("name", FLIGHT_STACKS)
def test_the_definitions_of_px4_in_our_fixtures_are_those_released(name: str) -> None:
    assert hasattr(px4_msgs.msg, name)
    assert built_hash("px4_msgs", name) == FLIGHT_STACKS[name]


def test_older_px4_reads_the_same_landing_target_but_for_the_padding() -> None:
    # PX4 1.14 to 1.16 have no rel_vel_ekf2_valid: in CDR it lies where theirs has padding.
    text = (REPOSITORY / "tests/harness/fixtures/px4_msgs/msg/LandingTargetPose.msg").read_text()
    older = get_typestore(Stores.EMPTY)
    name = "px4_msgs/msg/LandingTargetPose"
    older.register(get_types_from_msg(text.replace("bool rel_vel_ekf2_valid\n", ""), name))
    newer = get_typestore(Stores.EMPTY)
    newer.register(get_types_from_msg(text, name))
    fields = [line.split() for line in text.splitlines()]
    values = {
        field: kind == "bool" if kind == "bool" else index
        for index, (kind, field) in enumerate(fields, start=1)
    } | {"rel_vel_ekf2_valid": False}
    sent = newer.serialize_cdr(newer.types[name](**values), name)

    read = older.deserialize_cdr(sent, name)

    assert {field: getattr(read, field) for _, field in fields if field != "rel_vel_ekf2_valid"} == {
        field: value for field, value in values.items() if field != "rel_vel_ekf2_valid"
    }
