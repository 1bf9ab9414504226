"""The RViz configuration and the Foxglove layout name topics, types and fields that the node publishes.

Neither program runs here: their files are read as YAML and JSON and held against the node.
"""

import importlib
import json
from typing import Any

import pytest
import yaml

from harness.conftest import StartNode
from harness.peer import Peer
from harness.processes import REPOSITORY

# What the displays of rviz_default_plugins subscribe to.
RVIZ_TYPES = {
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
}
# Message types that Foxglove's 3D and diagnostics panels draw.
FOXGLOVE_3D_TYPES = set(RVIZ_TYPES.values())
FOXGLOVE_DIAGNOSTICS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"


@pytest.fixture
def published(start_node: StartNode, peer: Peer) -> dict[str, str]:
    """Type of every topic that the node publishes."""
    start_node("-p", "publish_markers:=true")

    def topics() -> dict[str, str]:
        pairs = peer.node.get_publisher_names_and_types_by_node("tanker_pose", "/")
        return {name: kind for name, (kind,) in pairs}

    peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node")
    wanted = {"/pose", "/status", "/diagnostics", "/markers"}
    peer.spin_until(lambda: wanted <= topics().keys(), "its topics")
    return topics()


def message_class(full_name: str) -> Any:
    package, kind, name = full_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def check_path(path: str, published: dict[str, str]) -> None:
    """A topic, and fields below it, all the way to a number."""
    topic, *fields = path.split(".")
    kind = published[topic]
    for field in fields:
        kind = message_class(kind).get_fields_and_field_types()[field]
        if "/" in kind:
            package, name = kind.split("/")
            kind = f"{package}/msg/{name}"
    assert kind in {"double", "uint8", "uint16"}, f"{path} ends at {kind}"


def test_the_rviz_configuration_shows_what_the_node_publishes(published: dict[str, str]) -> None:
    text = (REPOSITORY / "config/rviz/tanker_pose.rviz").read_text(encoding="utf-8")
    manager = yaml.safe_load(text)["Visualization Manager"]
    topics = {
        display["Topic"]["Value"]: display["Class"]
        for display in manager["Displays"]
        if "Topic" in display
    }

    assert topics.keys() == {"/pose", "/markers"}
    for topic, display in topics.items():
        assert published[topic] == RVIZ_TYPES[display]
    # The default of `tanker_pose simulate --frame-id`.
    assert manager["Global Options"]["Fixed Frame"] == "camera"


def panels_of(layout: Any) -> list[str]:
    """The panels that stand in the window."""
    if isinstance(layout, str):
        return [layout]
    assert layout["direction"] in {"row", "column"}
    return panels_of(layout["first"]) + panels_of(layout["second"])


def test_the_foxglove_layout_shows_what_the_node_publishes(published: dict[str, str]) -> None:
    text = (REPOSITORY / "config/foxglove/tanker_pose.json").read_text(encoding="utf-8")
    layout = json.loads(text)
    configurations = layout["configById"]

    assert sorted(panels_of(layout["layout"])) == sorted(configurations)
    named = set()
    for panel, configuration in configurations.items():
        match panel.partition("!")[0]:
            case "3D":
                for topic in configuration["topics"]:
                    assert published[topic] in FOXGLOVE_3D_TYPES
                    named.add(topic)
            case "Plot" | "StateTransitions":
                for path in configuration["paths"]:
                    check_path(path["value"], published)
                    named.add(path["value"].partition(".")[0])
            case "RawMessages":
                assert configuration["topicPath"] in published
            case "DiagnosticSummary":
                topic = configuration["topicToRender"]
                assert published[topic] == FOXGLOVE_DIAGNOSTICS_TYPE
                named.add(topic)
            case kind:
                raise AssertionError(f"no check for panels of kind {kind}")
    assert named == {"/pose", "/status", "/markers", "/diagnostics"}
