"""Parameters: from files and the command line, described, checked, and refused with a reason."""

import re
from pathlib import Path

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter as RclpyParameter
from rclpy.parameter import parameter_value_to_python
from ruamel.yaml import YAML

from harness import messages, paper
from harness.conftest import StartEstimator, StartNode
from harness.consistency import cramer_rao_covariance
from harness.estimator import Estimator
from harness.messages import covariance_of
from harness.peer import Peer
from harness.processes import REPOSITORY

def params_file(path: Path, **parameters: object) -> Path:
    lines = ["/**:", "  ros__parameters:"]
    lines += [f"    {name}: {value}" for name, value in parameters.items()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def get(peer: Peer, name: str, node: str = "/tanker_pose") -> ParameterValue:
    request = GetParameters.Request(names=[name])
    (value,) = peer.call(GetParameters, f"{node}/get_parameters", request).values
    return value


def set_one(peer: Peer, name: str, value: object):
    parameter: Parameter = RclpyParameter(name, value=value).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    (result,) = peer.call(SetParameters, "/tanker_pose/set_parameters", request).results
    return result


def test_a_params_file_is_obeyed(
    start_estimator: StartEstimator, peer: Peer, tmp_path: Path
) -> None:
    file = params_file(tmp_path / "params.yaml", pixel_sigma_px=1.25, min_points=6)
    estimator = start_estimator("--params-file", str(file))
    estimator.use_camera()

    assert get(peer, "pixel_sigma_px").double_value == 1.25
    five = messages.exact_frame(estimator.next_index())
    five.points = five.points[:5]
    estimator.expect_refusal(five, "TOO_FEW_POINTS")


def test_the_shipped_params_file_runs(start_estimator: StartEstimator) -> None:
    estimator = start_estimator("--params-file", str(REPOSITORY / "config" / "tanker_pose.yaml"))
    estimator.use_camera()

    estimator.expect_pose(messages.exact_frame(estimator.next_index()))


def test_the_shipped_params_file_lists_every_parameter_with_its_default(
    start_node: StartNode, peer: Peer
) -> None:
    text = (REPOSITORY / "config" / "tanker_pose.yaml").read_text(encoding="utf-8")
    listed = flattened(YAML(typ="safe").load(text)["/**"]["ros__parameters"])
    start_node()

    names = peer.call(
        ListParameters, "/tanker_pose/list_parameters", ListParameters.Request()
    ).result.names
    defaults = {name: parameter_value_to_python(get(peer, name)) for name in names}

    # What the topics bring under ROS's own names is not the file's to repeat.
    own = {name: value for name, value in defaults.items() if not name.startswith("qos_overrides.")}
    assert listed == own


def flattened(tree: dict[str, object], prefix: str = "") -> dict[str, object]:
    """Nested parameter names joined with dots, as ROS has them."""
    flat: dict[str, object] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            flat |= flattened(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


def test_the_command_line_wins_over_the_file(
    start_node: StartNode, peer: Peer, tmp_path: Path
) -> None:
    file = params_file(tmp_path / "params.yaml", pixel_sigma_px=1.25)

    start_node("--params-file", str(file), "-p", "pixel_sigma_px:=0.75")

    assert get(peer, "pixel_sigma_px").double_value == 0.75


def test_an_unknown_parameter_under_the_nodes_own_name_stops_it_by_name(
    start_node: StartNode, tmp_path: Path
) -> None:
    file = tmp_path / "params.yaml"
    file.write_text("tanker_pose:\n  ros__parameters:\n    pixel_sigma: 0.5\n", encoding="utf-8")
    node = start_node("--params-file", str(file))

    assert node.wait() != 0
    assert f"{file}, line 3: unknown parameter \"pixel_sigma\"" in node.log
    assert "panicked" not in node.log


def test_an_unknown_parameter_for_every_node_is_a_warning_with_the_likely_name(
    start_estimator: StartEstimator, tmp_path: Path
) -> None:
    file = params_file(tmp_path / "params.yaml", pixel_sigma=0.5, robot_description="<robot/>")
    estimator = start_estimator("--params-file", str(file))
    estimator.use_camera()

    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    log = estimator.process.log
    assert 'this node has no parameter "pixel_sigma", is pixel_sigma_px meant?' in log
    assert 'this node has no parameter "robot_description"\n' in log


def test_a_params_file_that_is_not_there_stops_the_node_by_name(start_node: StartNode) -> None:
    node = start_node("--params-file", "/nowhere/params.yaml")

    assert node.wait() != 0
    assert "/nowhere/params.yaml" in node.log


@pytest.mark.parametrize(
    "name, value",
    [
        ("pixel_sigma_px", "-1.0"),
        ("pixel_sigma_px", "wide"),
        ("initialisation", "guess"),
        ("refinement", "twice"),
        ("min_points", "2"),
        ("max_outliers", "-1"),
        ("tanker_frame_id", "''"),
        ("marker_map", "/nowhere/map.yaml"),
    ],
)
def test_a_bad_value_at_the_start_stops_the_node_by_name(
    start_node: StartNode, name: str, value: str
) -> None:
    node = start_node("-p", f"{name}:={value}")

    assert node.wait() != 0
    assert name in node.log
    assert "panicked" not in node.log


@pytest.mark.parametrize(
    "name, value",
    [
        ("pixel_sigma_px", -1.0),
        ("initialisation", "guess"),
        ("refinement", "twice"),
        ("min_points", 1),
    ],
)
def test_a_bad_value_while_running_is_refused_with_a_reason(
    start_node: StartNode, peer: Peer, name: str, value: object
) -> None:
    start_node()
    before = get(peer, name)

    result = set_one(peer, name, value)

    assert not result.successful
    assert result.reason.strip()
    assert get(peer, name) == before


def test_a_good_value_while_running_takes_effect(estimator: Estimator) -> None:
    result = set_one(estimator.peer, "pixel_sigma_px", 1.5)
    assert result.successful, result.reason

    frame = messages.exact_frame(estimator.next_index())
    for point in frame.points:
        point.sigma = 0.0
    answer = estimator.expect_pose(frame)

    expected = cramer_rao_covariance(paper.POSE, paper.MARKERS, paper.CAMERA, np.full(6, 1.5))
    assert answer.pose is not None
    assert covariance_of(answer.pose)[0, 0] == pytest.approx(expected[0, 0], rel=0.01)


HEAD = "name: test\nmarkers:\n"
MARKER_1 = "  - {id: 1, x: 1.0, y: 2.0, z: 0.0}\n"


@pytest.mark.parametrize(
    "text, line",
    [
        (
            f"{HEAD}{MARKER_1}  - {{id: 2, x: 3.0, y: 0.0, z: 1.0}}\n"
            "  - {id: 1, x: 2.0, y: 0.0, z: 0.0}\n",
            "5",
        ),
        (f"{HEAD}  - {{id: 1, x: 1.0, y: 2.0, z: .nan}}\n", "3"),
        (f"{HEAD}  - {{id: 1, x: 1.0, y: 2.0, z: 0.0, colour: red}}\n", "3"),
        (f"{HEAD}  - @\n", "3"),
    ],
    ids=["id twice", "not a number", "unknown key", "not YAML"],
)
def test_a_bad_marker_map_is_refused_with_file_and_line(
    start_node: StartNode, tmp_path: Path, text: str, line: str
) -> None:
    marker_map = tmp_path / "map.yaml"
    marker_map.write_text(text, encoding="utf-8")

    node = start_node("-p", f"marker_map:={marker_map}")

    assert node.wait() != 0
    place = node.log.partition(str(marker_map))[2]
    assert place, f"the file is not named:\n{node.log}"
    assert re.match(rf"\D{{0,8}}{line}\b", place), f"line {line} is not named:\n{node.log}"
