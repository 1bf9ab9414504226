"""The launch files as they run where ROS is not installed: by Python alone, with the same arguments.

`ros2 launch` itself is not on PyPI; what it is given are the programs and words that are started here.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rcl_interfaces.srv import GetParameters
from tanker_pose.msg import EstimatorStatus

from harness import messages
from harness.estimator import Estimator, Topics
from harness.peer import Peer
from harness.processes import REPOSITORY, Process, binary, children_of, plain_python
from harness.waiting import wait_until

FILES = sorted(path.name for path in (REPOSITORY / "launch_scripts").glob("*.launch.py"))
# Nothing of a ROS installation that this machine may have.
NO_ROS = {"PATH": "/nonexistent", "AMENT_PREFIX_PATH": ""}

Launch = Callable[..., Process]


@pytest.fixture
def launch(domain: int, tmp_path: Path) -> Iterator[Launch]:
    """Starts a launch file; one that still runs in the end is stopped, and takes all with it."""
    started: list[Process] = []

    def start(name: str, *words: str) -> Process:
        command = [plain_python(), str(REPOSITORY / "launch_scripts" / f"{name}.launch.py"), *words]
        environment = NO_ROS | {"TANKER_POSE_BIN_DIR": str(binary("tanker_pose").parent)}
        started.append(Process(command, domain, tmp_path / f"launch_{len(started)}", environment))
        return started[-1]

    yield start
    for process in started:
        print(f"--- {process.name} ---\n{process.log}")
        if process.running:
            end_with_all_it_started(process)


def end_with_all_it_started(process: Process) -> None:
    children = children_of(process.pid)
    try:
        process.stop()
    finally:
        process.kill_if_running()
    wait_until(
        lambda: not any(Path(f"/proc/{child}").exists() for child in children),
        f"what was launched ({children}) to end",
    )


def publishers(peer: Peer, node: str, namespace: str = "/") -> dict[str, str]:
    """Type of each topic that a node publishes; none while the node is not known."""
    if (node, namespace) not in peer.node.get_node_names_and_namespaces():
        return {}
    pairs = peer.node.get_publisher_names_and_types_by_node(node, namespace)
    return {topic: kind for topic, (kind,) in pairs}


def wait_for_publishers(peer: Peer, topics: set[str], node: str, namespace: str = "/") -> None:
    peer.spin_until(
        lambda: topics <= publishers(peer, node, namespace).keys(),
        f"{topics} of {namespace} {node}",
    )


def test_demo_flies_and_ctrl_c_ends_it(launch: Launch, peer: Peer) -> None:
    poses = peer.collect(PoseWithCovarianceStamped, "/pose")
    demo = launch("demo", "duration_s:=600", "marker_map:=fin6", "seed:=7")

    wait_for_publishers(peer, {"/pose", "/status", "/diagnostics"}, "tanker_pose")
    wait_for_publishers(peer, {"/feature_points", "/camera_info"}, "tanker_demo")
    peer.spin_until(lambda: len(poses) >= 10, "poses of the demo's node")
    end_with_all_it_started(demo)

    assert re.search(r'in 600 s at 30 Hz.*seed 7, tanker "fin6"', demo.log), demo.log
    peer.spin_until(lambda: not peer.sees_node("/tanker_pose"), "the demo's node to leave")


def test_camera_listens_and_speaks_under_the_names_asked_for(
    launch: Launch, peer: Peer, tmp_path: Path
) -> None:
    file = tmp_path / "own.yaml"
    file.write_text("/**:\n  ros__parameters: {marker_map: fin6, max_outliers: 2}\n")
    process = launch(
        "camera",
        "namespace:=receiver",
        "name:=eye",
        "camera:=nose",
        "detections:=/detector/beacons",
        f"params_file:={file}",
        "marker_map:=paper",
    )
    topics = Topics(
        "/detector/beacons", "/receiver/nose/camera_info", "/receiver/pose", "/receiver/status"
    )

    estimator = Estimator(peer, process, topics)
    estimator.wait_until_heard()
    estimator.use_camera()
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    assert peer.sees_node("/receiver/eye")
    request = GetParameters.Request(names=["marker_map", "max_outliers"])
    answer = peer.call(GetParameters, "/receiver/eye/get_parameters", request)
    assert answer.values[0].string_value == "paper"
    assert answer.values[1].integer_value == 2
    end_with_all_it_started(process)
    peer.spin_until(lambda: not peer.sees_node("/receiver/eye"), "the node to leave the graph")


def test_camera_with_tags_listens_to_their_detector(launch: Launch, peer: Peer) -> None:
    process = launch("camera", "input:=apriltags", "detections:=/tags")

    def heard() -> list[str]:
        return [info.topic_type for info in peer.node.get_subscriptions_info_by_topic("/tags")]

    peer.spin_until(lambda: bool(heard()), "a subscription to /tags")
    assert heard() == ["apriltag_msgs/msg/AprilTagDetectionArray"]
    end_with_all_it_started(process)


def test_simulation_is_estimated_and_its_end_ends_the_node(launch: Launch, peer: Peer) -> None:
    poses = peer.collect(PoseWithCovarianceStamped, "/sim/pose")
    statuses = peer.collect(EstimatorStatus, "/sim/status")
    process = launch("simulation", "namespace:=sim", "duration_s:=2", "rate_hz:=20")

    wait_until(lambda: not process.running, "the simulation to end", pause=lambda: peer.spin_for(0.05))

    assert process.wait() == 0, process.log
    assert "40 frames published" in process.log
    # Best effort may lose what was sent before the node had matched.
    assert len(statuses) >= 20
    assert len(poses) >= 20
    peer.spin_until(lambda: not peer.sees_node("/sim/tanker_pose"), "the node to leave the graph")


def test_endless_simulation_is_ended_by_ctrl_c(launch: Launch, peer: Peer) -> None:
    process = launch("simulation", "duration_s:=1", "loop:=true", "gross_error_every:=7")
    wait_for_publishers(peer, {"/feature_points", "/camera_info", "/truth"}, "tanker_simulation")
    wait_until(lambda: process.log.count("frame 6: marker") > 0, "a wrong detection")

    assert len(children_of(process.pid)) == 2
    end_with_all_it_started(process)

    for name in ("/tanker_simulation", "/tanker_pose"):
        peer.spin_until(lambda name=name: not peer.sees_node(name), f"{name} to leave the graph")


def test_visualisation_publishes_markers_and_tells_of_programs_that_are_missing(
    launch: Launch, peer: Peer
) -> None:
    process = launch(
        "visualisation", "namespace:=/receiver", "camera_frame:=nose", "receiver_frame:=base_link"
    )

    wait_for_publishers(peer, {"/receiver/markers", "/tf"}, "tanker_pose", "/receiver")
    kinds = publishers(peer, "tanker_pose", "/receiver")
    assert kinds["/receiver/markers"] == "visualization_msgs/msg/MarkerArray"
    (rviz,) = re.findall(r"rviz2 -d (\S+) -f nose$", process.log, re.MULTILINE)
    assert Path(rviz).is_file()
    assert "--frame-id base_link --child-frame-id nose" in process.log
    end_with_all_it_started(process)


@pytest.mark.parametrize(
    "name, word, said",
    [
        ("demo", "duration:=1", "there is no argument 'duration'"),
        ("camera", "input:=images", "input must be feature_points or detections or apriltags"),
        ("camera", "rectify:=true", "rectify_node of package image_proc was not found"),
        ("simulation", "loop", "expected name:=value, got 'loop'"),
        ("simulation", "duration_s:=-1", "expected a number from 0.001 to 86400, got -1"),
        ("visualisation", "params_file:=/nonexistent.yaml", "/nonexistent.yaml"),
    ],
)
def test_what_cannot_start_ends_with_a_reason(
    launch: Launch, name: str, word: str, said: str
) -> None:
    process = launch(name, word)

    assert process.wait() != 0
    assert said in process.log
    assert "Traceback" not in process.log


@pytest.mark.parametrize("name", FILES)
def test_help_lists_every_argument(launch: Launch, name: str) -> None:
    process = launch(name.removesuffix(".launch.py"), "--help")

    assert process.wait() == 0
    source = (REPOSITORY / "launch_scripts" / name).read_text(encoding="utf-8")
    arguments = re.findall(r'Argument\(\s*"(\w+)"', source)
    assert arguments
    for argument in arguments:
        assert f"  {argument} (" in process.log
