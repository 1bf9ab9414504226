"""A wrong sign in each of mount, nominal attitude, probe tip, camera and receptacle: what is noticed, and what cannot be.

The table in docs/diagnostics.md says the same in words.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from tanker_pose.msg import ReceptacleState

from harness import messages, paper
from harness.approach import (
    CAMERA,
    CAMERA_IN_RECEIVER,
    PROBE_TIP_IN_RECEIVER,
    RECEPTACLE_IN_TANKER,
    SETUP,
)
from harness.conftest import StartNode
from harness.peer import BEST_EFFORT, Peer
from harness.processes import Process
from harness.rotations import Array, Pose, about_x, about_y, about_z
from sensor_msgs.msg import CameraInfo
from tanker_pose.msg import FeaturePointArray

Angles = tuple[float, float, float]
AXES = ("roll", "pitch", "yaw")

# How the camera is turned in truth, and how the tanker is expected to fly, deg.
MOUNT: Angles = (9.0, -14.0, 10.0)
NOMINAL: Angles = (-9.0, 9.0, 10.0)
# As it does fly: nearly so.
FLOWN: Angles = (-8.5, 9.5, 9.0)
# From the probe tip to the receptacle, receiver axes, m.
RECEPTACLE_FROM_PROBE = np.array([8.0, 0.5, -0.3])
# m; of a pose at 17 m from exact pixels, and of the filter.
SAME_M = 0.05

PACE_S = 0.05
# Said after 3 s, looked for every second.
PATIENCE_S = 20.0
# Poses for that long without a fault show that there will be none.
QUIET_S = 6.0
LIMIT_DEG = 15.0


def turned(angles: Angles) -> Array:
    roll, pitch, yaw = np.radians(angles)
    return about_z(yaw) @ about_y(pitch) @ about_x(roll)


def with_sign(angles: Angles, axis: int) -> Angles:
    return tuple(-angle if i == axis else angle for i, angle in enumerate(angles))


def camera_from_tanker(mount: Angles) -> Pose:
    """What a camera with this mount sees of the tanker."""
    receiver_from_camera = turned(mount) @ paper.CAMERA_FROM_RECEIVER.T
    receiver_from_tanker = turned(FLOWN)
    tanker = (
        PROBE_TIP_IN_RECEIVER
        + RECEPTACLE_FROM_PROBE
        - receiver_from_tanker @ RECEPTACLE_IN_TANKER
    )
    return Pose(
        rotation=receiver_from_camera.T @ receiver_from_tanker,
        translation=receiver_from_camera.T @ (tanker - CAMERA_IN_RECEIVER),
    )


def arguments_of(mount: Angles, nominal: Angles, setup: Path = SETUP) -> list[str]:
    arguments = ["-p", f"refuelling:={setup}", "-p", "publish_receptacle:=true"]
    arguments += ["-p", "publish_mavros_landing_target:=true"]
    for prefix, angles in [("camera_mount", mount), ("nominal", nominal)]:
        for axis, angle in zip(AXES, angles, strict=True):
            arguments += ["-p", f"{prefix}_{axis}_deg:={angle}"]
    return arguments


class Flight:
    """A node behind a camera that is truly mounted in one way, whatever the node was told."""

    def __init__(
        self, peer: Peer, process: Process, mount: Angles = MOUNT
    ) -> None:
        self.peer = peer
        self.process = process
        self.pixels = paper.marker_pixels(camera_from_tanker(mount), CAMERA)
        assert CAMERA.sees(self.pixels, margin_px=5.0)
        self.told: list[ReceptacleState] = peer.collect(ReceptacleState, "/receptacle")
        self.reports: list[DiagnosticArray] = peer.collect(DiagnosticArray, "/diagnostics")
        self.info = peer.node.create_publisher(CameraInfo, "/camera_info", BEST_EFFORT)
        self.points = peer.node.create_publisher(FeaturePointArray, "/feature_points", BEST_EFFORT)
        self.index = 0

    def step(self) -> None:
        self.index += 1
        self.info.publish(messages.camera_info(CAMERA))
        self.points.publish(messages.feature_points(self.index, self.pixels))
        self.peer.spin_for(PACE_S)

    def step_until(self, condition: Callable[[], object], what: str) -> None:
        try:
            self.peer.spin_until(lambda: self.step() or bool(condition()), what, PATIENCE_S)
        except AssertionError as error:
            raise AssertionError(f"{error}:\n{self.process.log}") from error

    def steps_for(self, duration_s: float) -> None:
        for _ in range(round(duration_s / PACE_S)):
            self.step()

    def values(self, part: str) -> dict[str, str]:
        """What the latest report says in a part."""
        if not self.reports:
            return {}
        (status,) = (s for s in self.reports[-1].status if s.name.endswith(f": {part}"))
        return {pair.key: pair.value for pair in status.values}

    @property
    def fault(self) -> str:
        return self.values("faults").get("unexpected_attitude", "")

    def poses(self) -> int:
        return int(self.values("estimation").get("estimates", "0"))

    def set(self, name: str, value: float) -> None:
        number = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=number)])
        (result,) = self.peer.call(
            SetParameters, "/tanker_pose/set_parameters", request
        ).results
        assert result.successful, result.reason

    def receptacle(self) -> Array:
        """Where the node has the receptacle from the probe tip, told from now on."""
        self.told.clear()
        self.step_until(lambda: len(self.told) > 3, "the receptacle")
        position = self.told[-1].position
        return np.array([position.x, position.y, position.z])

    def lines(self, beginning: str) -> list[str]:
        return [line for line in self.process.log.splitlines() if f": {beginning}" in line]


@pytest.fixture
def fly(start_node: StartNode, peer: Peer) -> Callable[..., Flight]:
    def start(
        *more: str,
        mount: Angles = MOUNT,
        nominal: Angles = NOMINAL,
        setup: Path = SETUP,
        truly: Angles = MOUNT,
    ) -> Flight:
        return Flight(peer, start_node(*arguments_of(mount, nominal, setup), *more), truly)

    return start


def assert_noticed_and_cleared(flight: Flight, cause: str, mend: Callable[[], None]) -> None:
    """Nothing is told from the first frame on; the fault has its cause; once it is mended all is told, and true."""
    flight.step_until(lambda: flight.fault, "the fault")
    assert cause in flight.fault, flight.fault
    assert "receptacle and the outputs to flight stacks are held back" in flight.fault
    assert flight.poses() > 0 and flight.told == []
    consumers = flight.values("consumers")
    for output in ("receptacle", "/mavros/landing_target/raw"):
        assert consumers[f"{output}.published"] == "0" and int(consumers[f"{output}.silent"]) > 0
    (line,) = flight.lines("unexpected_attitude: ")
    assert "[WARN]" in line and cause in line
    assert any("off its nominal attitude" in line for line in flight.lines("no receptacle"))

    mend()
    found = flight.receptacle()
    assert np.linalg.norm(found - RECEPTACLE_FROM_PROBE) < SAME_M, found
    flight.step_until(lambda: flight.fault == "", "the end of the fault")
    assert len(flight.lines("unexpected_attitude is over after")) == 1
    assert "panicked" not in flight.process.log


@pytest.mark.parametrize("axis", range(3), ids=AXES)
@pytest.mark.parametrize("what", ["camera_mount", "nominal"])
def test_a_wrong_sign_of_an_angle_is_a_fault_with_its_cause_and_holds_all_outputs_back(
    fly: Callable[..., Flight], what: str, axis: int
) -> None:
    truth = MOUNT if what == "camera_mount" else NOMINAL
    wrong = with_sign(truth, axis)
    flight = fly(mount=wrong) if what == "camera_mount" else fly(nominal=wrong)
    name = f"{what}_{AXES[axis]}_deg"

    assert_noticed_and_cleared(
        flight,
        f"the sign of {name}: {truth[axis]:g} instead of {wrong[axis]:g}",
        lambda: flight.set(name, truth[axis]),
    )


LEVEL: Angles = (0.0, 0.0, 0.0)
UPSIDE_DOWN: Angles = (180.0, 0.0, 0.0)


def test_a_camera_upside_down_gives_no_pose_from_a_nominal_start(
    fly: Callable[..., Flight]
) -> None:
    flight = fly(mount=LEVEL, nominal=FLOWN, truly=UPSIDE_DOWN)
    flight.steps_for(QUIET_S)

    assert flight.poses() == 0 and flight.told == []
    assert "camera_mount" in flight.values("estimation")["last_message"]


def test_a_camera_upside_down_is_a_fault_with_its_cause_where_any_attitude_is_found(
    fly: Callable[..., Flight]
) -> None:
    flight = fly("-p", "initialisation:=global", mount=LEVEL, nominal=FLOWN, truly=UPSIDE_DOWN)

    assert_noticed_and_cleared(
        flight,
        "camera_mount_roll_deg -180 instead of 0",
        lambda: flight.set("camera_mount_roll_deg", 180.0),
    )


def test_an_unexpected_attitude_can_be_allowed(fly: Callable[..., Flight]) -> None:
    # The truth is a tanker that flies so, and the user knows.
    flight = fly(nominal=LEVEL)
    off_deg = np.degrees(np.arccos((np.trace(turned(FLOWN)) - 1) / 2))
    assert off_deg > LIMIT_DEG

    assert_noticed_and_cleared(
        flight,
        f"stands {off_deg:.1f}° off its nominal attitude",
        lambda: flight.set("max_attitude_deviation_deg", 180.0),
    )


def test_a_right_setup_is_said_in_words_and_no_fault(fly: Callable[..., Flight]) -> None:
    flight = fly()
    flight.steps_for(QUIET_S)

    assert flight.poses() > 0 and flight.fault == ""
    found = flight.receptacle()
    assert np.linalg.norm(found - RECEPTACLE_FROM_PROBE) < SAME_M, found
    for words in (
        "mount: the camera looks 14.0° up, 10.0° left, rolled 9.0°, its right side low",
        "nominal attitude: the tanker flies with its nose lower by 9.0°, nose to the left by 10.0°, left wing lower by 9.0°",
        "camera_in_receiver: the camera is 1.0 m ahead, 0.8 m above the receiver's origin",
        "probe_tip_in_receiver: the probe tip is 4.0 m ahead, 0.5 m right, 0.2 m above the camera",
        "receptacle_in_tanker: the receptacle is 4.0 m behind, 2.5 m below the tanker's origin",
    ):
        (line,) = flight.lines(words)
        assert "[INFO]" in line
    for word in ("check", "sign"):
        assert not [line for line in flight.process.log.splitlines() if "[WARN]" in line and word in line]


def test_a_wrong_sign_of_a_small_angle_cannot_be_noticed(fly: Callable[..., Flight]) -> None:
    # Twice the angle stays below the limit; only the words at the start tell.
    truth = (0.0, -5.0, 0.0)
    flight = fly(mount=(0.0, 5.0, 0.0), nominal=FLOWN, truly=truth)
    flight.steps_for(QUIET_S)

    assert flight.fault == ""
    error_m = np.linalg.norm(flight.receptacle() - RECEPTACLE_FROM_PROBE)
    assert error_m > 1.0, "else it would not matter"
    assert flight.lines("mount: the camera looks 5.0° down")


LEVER_ARMS: dict[str, tuple[str, Array, dict[str, str]]] = {
    # Which key, what is there, and for each sign that can be noticed the warning at the start.
    "probe_tip_in_receiver": (
        "probe_tip_in_receiver: {x: 5.0, y: -0.5, z: 1.0}",
        PROBE_TIP_IN_RECEIVER,
        {"x": "the probe tip is 6.0 m behind the camera"},
    ),
    "camera_in_receiver": (
        "camera_in_receiver: {x: 1.0, y: 0.0, z: 0.8}",
        CAMERA_IN_RECEIVER,
        {},
    ),
    "receptacle_in_tanker": (
        "receptacle_in_tanker: {x: -4.0, y: 0.0, z: -2.5}",
        RECEPTACLE_IN_TANKER,
        {"x": "within 60° of the camera's axis, a pose needs 5"},
    ),
}
WRONG_SIGNS = [
    (key, axis)
    for key, (_, values, _) in LEVER_ARMS.items()
    for axis, value in zip("xyz", values, strict=True)
    if value != 0.0
]


@pytest.mark.parametrize("key, axis", WRONG_SIGNS)
def test_a_wrong_sign_of_a_lever_arm_shows_at_the_start_or_not_at_all(
    fly: Callable[..., Flight], tmp_path: Path, key: str, axis: str
) -> None:
    stated, values, noticed = LEVER_ARMS[key]
    text = SETUP.read_text(encoding="utf-8")
    assert stated in text
    index = "xyz".index(axis)
    wrong = values.copy()
    wrong[index] *= -1
    x, y, z = wrong
    setup = tmp_path / "setup.yaml"
    setup.write_text(text.replace(stated, f"{key}: {{x: {x}, y: {y}, z: {z}}}"), encoding="utf-8")
    flight = fly(mount=LEVEL, nominal=FLOWN, setup=setup, truly=LEVEL)
    flight.steps_for(QUIET_S)

    # The attitude is right, whatever a lever arm is: no fault, and an answer that looks right and is not.
    assert flight.fault == ""
    error_m = np.linalg.norm(flight.receptacle() - RECEPTACLE_FROM_PROBE)
    assert error_m == pytest.approx(2 * abs(values[index]), abs=SAME_M)
    warnings = [line for line in flight.process.log.splitlines() if "[WARN]" in line]
    found = [line for line in warnings if key in line or noticed.get(axis, key) in line]
    assert bool(found) == (axis in noticed), found
    if axis in noticed:
        assert any(noticed[axis] in line for line in found), found
    # What people can compare with the aircraft is there in any case.
    (line,) = flight.lines(f"{key}: the ")
    assert "[INFO]" in line
