"""What files and arguments say at the start: rclpy is the oracle, and each difference from it stands here with its reason.

An rclpy node that declares the same parameters with the same defaults, in a context of its own for every case, is asked
for its values. The node's side is `tanker_pose parameters`, which reads arguments by the node's own code.
"""

import math
import subprocess
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ruamel.yaml import YAML

from harness.domains import claimed_domain
from harness.processes import binary, child_environment

NODE = "tanker_pose"
REFUSED = "refused"


def section(pattern: str, *lines: str) -> str:
    return f"{pattern}:\n  ros__parameters:\n" + "".join(f"    {line}\n" for line in lines)


def ours(arguments: list[str]) -> dict[str, Any] | str:
    """The parameters that the node starts with, or that it does not start."""
    result = subprocess.run(
        [binary("tanker_pose"), "parameters", "--ros-args", *arguments],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=10.0,
        check=False,
    )
    if result.returncode != 0:
        # No parser's own words, and no panic.
        assert result.stderr.startswith("tanker_pose: ") and "from_str" not in result.stderr
        return REFUSED
    (node,) = YAML(typ="safe").load(result.stdout).values()
    return node["ros__parameters"]


@pytest.fixture(scope="module")
def defaults() -> dict[str, Any]:
    values = ours([])
    assert isinstance(values, dict)
    return {name: value for name, value in values.items() if name != "use_sim_time"}


def rclpys(arguments: list[str], defaults: dict[str, Any]) -> dict[str, Any] | str:
    """The same of an rclpy node that declares the same parameters.

    In a domain of its own: Fast DDS may wait forever for its own callbacks when a participant ends while it discovers
    those of other tests.
    """
    context = Context()
    node = None
    with claimed_domain() as domain:
        try:
            rclpy.init(args=["--ros-args", *arguments], context=context, domain_id=domain)
            node = Node(NODE, context=context, start_parameter_services=False, enable_rosout=False)
            return {
                name: node.declare_parameter(name, value).value for name, value in defaults.items()
            }
        except Exception:  # noqa: BLE001 rcl's own classes are private
            return REFUSED
        finally:
            if node is not None:
                node.destroy_node()
            if context.ok():
                context.shutdown()


def written(case: list[str], directory: Path) -> list[str]:
    """The arguments of a case, its files written: what begins with `file ` is the text of one."""
    arguments = []
    for number, part in enumerate(case):
        if part.startswith("file "):
            path = directory / f"{number}.yaml"
            path.write_text(part.removeprefix("file "), encoding="utf-8")
            arguments += ["--params-file", str(path)]
        elif part.startswith("-"):
            arguments += part.split(" ")
        else:
            arguments += ["-p", part]
    return arguments


# One whole-number parameter in different places; the values differ, so that what counts shows.
P = "px4_minus_ros_us"


def file(*sections: tuple[str, int]) -> str:
    return "file " + "".join(section(pattern, f"{P}: {value}") for pattern, value in sections)


PRECEDENCE = [
    [file(("/**", 7), (NODE, 6))],
    [file((NODE, 6), ("/**", 7))],
    [file(("/**", 7), (NODE, 6)), file(("/**", 8))],
    [file(("/**", 7), (NODE, 6)), file(("/**", 8)), f"{P}:=9"],
    [f"{P}:=9", file(("/**", 7), (NODE, 6))],
    [file(("/**", 7), (NODE, 6)), f"{P}:=9"],
    [f"{P}:=9", file(("/**", 8))],
    [file(("/**", 8)), f"{P}:=9"],
    [file((NODE, 6)), f"{P}:=9"],
    [f"{P}:=9", file((NODE, 6))],
    [file((NODE, 6)), f"{NODE}:{P}:=9"],
    [f"{NODE}:{P}:=9", file((NODE, 6))],
    [f"{NODE}:{P}:=9", f"{P}:=8"],
    [f"{P}:=8", f"{NODE}:{P}:=9"],
    [f"{P}:=8", f"{P}:=9"],
    [f"other:{P}:=9"],
    [f"other:{P}:=9", f"{P}:=3"],
    [file(("/*", 1))],
    [file(("/*", 1), ("/**", 3))],
    [file(("/**", 3), ("/*", 1))],
    [file(("/*", 1), (NODE, 2), ("/**", 3))],
    [file(("/**/tanker_pose", 1))],
    [file(("/**/tanker_pose", 1), (NODE, 2))],
    [file(("/*/tanker_pose", 1))],
    [file(("/tanker_pose", 1))],
    [file(("/tanker_pose", 1), (NODE, 2))],
    [file((NODE, 2), ("/tanker_pose", 1))],
    [file(("/tanker_pose", 1), (NODE, 2)), file(("/tanker_pose", 3))],
    [file(("other", 1))],
    [file(("/uav1/tanker_pose", 1))],
    [file(("/uav1/tanker_pose", 1)), "-r __ns:=/uav1"],
    [file((NODE, 1)), "-r __ns:=/uav1"],
    [file(("/*/tanker_pose", 1)), "-r __ns:=/uav1"],
    [file(("/**/tanker_pose", 1)), "-r __ns:=/uav1/left"],
    [file(("/*/tanker_pose", 1)), "-r __ns:=/uav1/left"],
    [file(("/uav1/**", 1)), "-r __ns:=/uav1"],
    [file(("/uav1/*", 1)), "-r __ns:=/uav1"],
    ["file " + f"uav1:\n  tanker_pose:\n    ros__parameters:\n      {P}: 4\n", "-r __ns:=/uav1"],
    [f"{NODE}:{P}:=9", "-r __ns:=/uav1"],
    [file(("other", 1)), "-r __node:=other"],
    [file((NODE, 1)), "-r __node:=other"],
    [f"other:{P}:=9", "-r __node:=other"],
    ["file "],
    ["file # nothing\n"],
    ["file " + section("/**", f"{P}: 5", "robot_description: <xml/>", "others: {a: [1, 2], b: x}")],
]

REFUSALS = [
    [f"/**:{P}:=1"],
    [f"/{NODE}:{P}:=1"],
    [f"{P}:="],
    [P],
    [":=1"],
    [f"{P}:=@x"],
    [f"{P}:={{a: 1}}"],
    ["file " + section("/**", f"{P}: [1, 2]")],
    ["file " + section(NODE, f"{P}: ")],
    ["file " + section(NODE, f"{P}: *x")],
    ["-r /**:pose:=x"],
    [f"-r /{NODE}:pose:=x"],
    ["file - a\n"],
    ["file {\n"],
    ["file " + f"{NODE}: 1\n"],
    ["--params-file /nonexistent.yaml"],
    ["--log-level loud"],
    [f"{P}:=1.5"],
    [f"{P}:=yes"],
    ["publish_tf:=1"],
    ["tanker_frame_id:=1"],
    ["tanker_frame_id:=yes"],
]

ACCEPTED = [
    ["--log-file-name tanker"],
    ["--log-level UNSET"],
    ["--log-level tanker_pose:=debug"],
    ["--disable-rosout-logs"],
    ["-e /enclave"],
]

# Words; each is given to the parameter of the type that rclpy finds in it, by -p and in a file.
WORDS = [
    *["yes", "Yes", "YES", "no", "No", "NO", "on", "On", "ON", "off", "Off", "OFF", "y", "Y", "n", "N"],
    *["true", "True", "TRUE", "false", "False", "FALSE", "tRue", "yEs", "oN"],
    *["010", "-010", "0x10", "0X1f", "-0x10", "0o10", "0b1", "00", "0", "-0", "+1", "1_000", "0x"],
    *["9000000000000000", "08", "1.", ".5", "-.5", "+1.5", "1e2", "1E2", "1e", "e1", "1d3", "--1"],
    *["1e400", "1e-400", "0e5", "~", "null", "''", '""', "'1'", '"yes"', "!!str 1", "!!str yes", "!!int 3", "!!bool yes"],
    *["1,2", "12:30", "2001-01-01", "a#b", "a:b", "abc", "0.0", "1.5e1", "&x 1"],
]
OF_TYPE = {bool: "publish_tf", int: P, float: "camera_mount_roll_deg", str: "tanker_frame_id"}

# Deliberate differences, by the case, with what the node does and why.
DIFFERENCES: dict[str, tuple[str, str]] = {
    # A slip that nobody would see.
    "the_same_parameter_twice": (REFUSED, "file " + section(NODE, f"{P}: 1", f"{P}: 2")),
    "the_same_parameter_in_two_sections": (
        REFUSED,
        "file " + section(NODE, f"{P}: 1") + section(NODE, f"{P}: 2"),
    ),
    "two_documents": (REFUSED, "file " + section(NODE, f"{P}: 1") + "---\n" + section(NODE, f"{P}: 2")),
    "unknown_under_our_own_name": (REFUSED, "file " + section(NODE, "px4_minus_ros: 1")),
    "unknown_as_an_argument": (REFUSED, "px4_minus_ros:=1"),
    # Meant by everybody who writes it.
    "a_whole_number_for_a_number": ("accepted", "camera_mount_roll_deg:=1"),
    # None of our business: ROS reads all sections by the same rules.
    "a_mixed_list_of_another_node": ("accepted", "file " + section("other", "a: [1, x]")),
    "an_alias_of_another_node": ("accepted", "file " + section("other", "a: &x 1", "b: *x")),
    # No frame has such a name.
    "empty_text": (REFUSED, "tanker_frame_id:=''"),
    # A file that holds something else is the wrong file.
    "a_file_of_mere_text": (REFUSED, "file just text\n"),
    "a_comment_for_a_value": (REFUSED, f"{P}:=#1"),
    "an_empty_map_for_a_value": (REFUSED, "file " + section(NODE, f"{P}: {{}}")),
    # A section whose lines are all commented out.
    "nothing_under_ros__parameters": ("accepted", "file " + f"{NODE}:\n  ros__parameters:\n"),
}


def compare(case: list[str], directory: Path, defaults: dict[str, Any]) -> None:
    arguments = written(case, directory)
    expected, found = rclpys(arguments, defaults), ours(arguments)
    if isinstance(found, dict):
        found = {name: found[name] for name in defaults}
    assert found == expected, case


@pytest.mark.parametrize("case", PRECEDENCE, ids=repr)
def test_the_value_that_counts_is_that_of_ros(
    case: list[str], tmp_path: Path, defaults: dict[str, Any]
) -> None:
    compare(case, tmp_path, defaults)


@pytest.mark.parametrize("case", REFUSALS, ids=repr)
def test_what_ros_refuses_is_refused(
    case: list[str], tmp_path: Path, defaults: dict[str, Any]
) -> None:
    compare(case, tmp_path, defaults)
    assert ours(written(case, tmp_path)) == REFUSED


@pytest.mark.parametrize("case", ACCEPTED, ids=repr)
def test_what_ros_accepts_is_accepted(
    case: list[str], tmp_path: Path, defaults: dict[str, Any]
) -> None:
    assert isinstance(ours(written(case, tmp_path)), dict)
    compare(case, tmp_path, defaults)


@pytest.mark.parametrize("place", ["argument", "file"])
@pytest.mark.parametrize("word", WORDS)
def test_a_word_means_what_it_means_in_ros(
    word: str, place: str, tmp_path: Path, defaults: dict[str, Any]
) -> None:
    """The type that a word has is found by offering it to a parameter of each."""
    agreed = []
    for kind, name in OF_TYPE.items():
        case = f"{name}:={word}" if place == "argument" else "file " + section("/**", f"{name}: {word}")
        arguments = written([case], tmp_path)
        expected, found = rclpys(arguments, defaults), ours(arguments)
        # Listed below: whole numbers serve as numbers, and a frame needs a name without spaces.
        if kind is float and expected == REFUSED and isinstance(found, dict):
            assert math.trunc(found[name]) == found[name]
            continue
        if kind is str and isinstance(expected, dict) and not expected[name]:
            assert found == REFUSED
            agreed.append(kind)
            continue
        if expected == REFUSED or found == REFUSED:
            assert found == expected, (name, expected, found)
            continue
        assert found[name] == expected[name] and type(found[name]) is type(expected[name])
        agreed.append(kind)
    assert len(agreed) <= 1, agreed


@pytest.mark.parametrize("name", DIFFERENCES)
def test_each_listed_difference_is_one(name: str, tmp_path: Path, defaults: dict[str, Any]) -> None:
    expected, case = DIFFERENCES[name]
    arguments = written([case], tmp_path)
    found = ours(arguments)
    assert (found == REFUSED) == (expected == REFUSED)
    theirs = rclpys(arguments, defaults)
    assert theirs != (found if found == REFUSED else {key: found[key] for key in defaults})
