"""The node's protection levels over DDS: every state, the numbers of `solve`, and outputs that depend on them."""

import json
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from tanker_pose.msg import FeaturePointArray, Integrity, ReceptacleState

from harness import messages, paper
from harness.conftest import StartEstimator, StartNode
from harness.estimator import Estimator
from harness.messages import SIGMA_PX, key
from harness.peer import Peer
from harness.processes import REPOSITORY
from harness.rotations import Array
from harness.solver import solve

TOPIC = "/integrity"
STATES = {
    value: name for name, value in type(Integrity).__prepare__("Integrity", ()).items()
}
# The paper's markers and two more on the wings.
EIGHT = {**paper.MARKERS, 7: (4.0, -3.5, 0.5), 8: (4.0, 3.5, 0.5)}
EXAMPLE_SETUP = REPOSITORY / "config/refuelling/example.yaml"
POINT = "{name: tail, x: 7.8, y: 0.0, z: 1.0}"


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    path = tmp_path / "eight.yaml"
    listed = "".join(f"  - {{id: {i}, x: {x}, y: {y}, z: {z}}}\n" for i, (x, y, z) in EIGHT.items())
    path.write_text(f"name: eight\nmarkers:\n{listed}points:\n  - {POINT}\n", encoding="utf-8")
    return path


class Protected:
    """A node that publishes protection levels, and frames for it."""

    def __init__(self, peer: Peer, start: StartEstimator, map_file: Path, *parameters: str) -> None:
        self.peer = peer
        # Before the status is subscribed to: once the node answers, it has found this one, too.
        self.integrity = peer.collect(Integrity, TOPIC)
        self.estimator: Estimator = start(
            *("-p", f"marker_map:={map_file}", "-p", "publish_integrity:=true"),
            *(part for parameter in parameters for part in ("-p", parameter)),
        )
        self.estimator.use_camera()

    def frame(self, pixels: Array | None = None, ids: tuple[int, ...] = tuple(EIGHT)) -> Integrity:
        """What the node says of these detections; exact ones unless given."""
        if pixels is None:
            pixels = exact(ids)
        message = messages.feature_points(self.estimator.next_index(), pixels, ids=ids)
        return self.ask(message)

    def ask(self, message: FeaturePointArray) -> Integrity:
        self.estimator.ask(message)
        stamp = key(message.header.stamp)

        def found() -> list[Integrity]:
            return [m for m in self.integrity if key(m.header.stamp) == stamp]

        self.peer.spin_until(lambda: found() != [], "protection levels of the frame")
        (integrity,) = found()
        assert integrity.header == message.header
        return integrity


def exact(ids: tuple[int, ...] = tuple(EIGHT)) -> Array:
    return paper.marker_pixels(paper.POSE, markers={i: EIGHT[i] for i in ids})


def numbers(vector: object) -> Array:
    return np.array([getattr(vector, axis) for axis in "xyz"])


def test_every_state_says_its_reason_and_levels_are_those_of_solve(
    peer: Peer, start_estimator: StartEstimator, map_file: Path
) -> None:
    node = Protected(peer, start_estimator, map_file)
    rng = np.random.default_rng(5)
    noisy = exact() + rng.normal(0.0, SIGMA_PX, (len(EIGHT), 2))

    found = node.frame(noisy)

    assert (STATES[found.state], found.message) == ("AVAILABLE", "")
    (point,) = found.points
    assert point.name == "tail"
    assert np.isnan(numbers(point.alert_limit)).all()
    assert all(name.startswith("marker ") for name in point.weakest)
    assert (numbers(point.protection_level) > 4.0 * numbers(point.sigma)).all()
    assert found.hmi_probability == 1e-7
    assert 0.0 < found.unmonitored_probability < 1e-7
    camera = {"width": 508, "height": 412, "k": [571, 0, 254, 0, 571, 206, 0, 0, 1]}
    points = [
        {"id": i, "u": float(u), "v": float(v), "sigma": SIGMA_PX}
        for i, (u, v) in zip(EIGHT, noisy, strict=True)
    ]
    line = json.dumps({"id": 1, "camera": camera, "points": points})
    (answer,) = solve(line, arguments=("--marker-map", str(map_file), "--protection-levels"))
    (offline,) = answer["integrity"]["points"]
    assert offline["protection_level"] == pytest.approx(numbers(point.protection_level), rel=1e-6)
    assert offline["weakest"] == list(point.weakest)

    # Five points: without two of them three would remain, which fix up to four poses.
    five = node.frame(ids=tuple(EIGHT)[:5])
    assert STATES[five.state] == "UNMONITORED"
    assert "the other points do not fix one pose" in five.message
    assert np.isnan(numbers(five.points[0].protection_level)).all()
    assert np.isnan(five.unmonitored_probability)

    few = node.frame(ids=tuple(EIGHT)[:3])
    assert (STATES[few.state], few.message) == ("NO_POSE", "no trusted pose")

    # Small enough for the residuals' test of eight points, too large for the separation without it.
    states = []
    for shift_px in np.arange(1.5, 4.0, 0.1):
        pixels = exact()
        pixels[2] += [shift_px, 0.0]
        message = node.frame(pixels)
        states.append(STATES[message.state])
        if states[-1] == "FAULT":
            assert "the beacons contradict each other: without marker" in message.message
    assert states[0] == "AVAILABLE"
    assert "FAULT" in states, states


def test_alert_limits_hold_outputs_back_until_they_are_kept(
    peer: Peer, start_estimator: StartEstimator, map_file: Path, tmp_path: Path
) -> None:
    example = EXAMPLE_SETUP.read_text(encoding="utf-8")
    setup = tmp_path / "setup.yaml"
    limit = "alert_limit: {ahead_m: 1.0, lateral_m: 0.6, vertical_m: 0.6}\n"
    setup.write_text(f"{example}\n{limit}", encoding="utf-8")
    receptacle = peer.collect(ReceptacleState, "/receptacle")
    diagnostics = peer.collect(DiagnosticArray, "/diagnostics")
    node = Protected(
        peer,
        start_estimator,
        map_file,
        "publish_receptacle:=true",
        "require_integrity:=true",
        f"refuelling:={setup}",
    )

    # Far away levels are too large for the limits; the track and its receptacle would begin all the same.
    far = paper.camera_from_tanker(0.0, 0.0, 0.0, (45.0, 0.0, 13.5))
    pixels = paper.marker_pixels(far, markers=EIGHT)
    for _ in range(10):
        message = node.frame(pixels)
        assert STATES[message.state] == "ABOVE_LIMIT"
        assert "protection level of receptacle is" in message.message
    assert receptacle == []

    node.peer.spin_until(
        lambda: any(
            status.name.endswith(": integrity") and "protection level of receptacle" in status.message
            for array in diagnostics
            for status in array.status
        ),
        "diagnostics with the reason",
    )
    counts = next(
        {value.key: value.value for value in status.values}
        for array in reversed(diagnostics)
        for status in array.status
        if status.name.endswith(": integrity")
    )
    assert int(counts["above_limit"]) > 0 and counts["available"] == "0"

    # 15 m ahead they are kept; the jump contradicts the track, which ends after a second and begins anew.
    near = [node.frame() for _ in range(80)]
    assert {STATES[message.state] for message in near} == {"AVAILABLE"}
    assert [point.name for point in near[-1].points] == ["receptacle", "tail"]
    node.peer.spin_until(lambda: receptacle != [], "the receptacle once levels keep their limits")


def test_what_cannot_be_computed_is_refused_at_the_start(start_node: StartNode) -> None:
    for parameters, complaint in [
        (("require_integrity:=true",), "require_integrity needs publish_integrity"),
        (
            ("publish_integrity:=true", "refinement:=none"),
            "publish_integrity needs refinement maximum_likelihood",
        ),
        (
            ("publish_integrity:=true", "nominal_attitude_sigma_deg:=3.0"),
            "publish_integrity does not go with nominal_attitude_sigma_deg",
        ),
        (
            (
                *("publish_integrity:=true", "require_integrity:=true"),
                *("publish_receptacle:=true", f"refuelling:={EXAMPLE_SETUP}"),
            ),
            "has no alert_limit to keep",
        ),
    ]:
        node = start_node(
            *(part for parameter in parameters for part in ("-p", parameter)),
        )
        assert node.wait() != 0
        assert complaint in node.log


def test_without_the_parameter_there_is_no_such_topic(estimator: Estimator, peer: Peer) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    assert peer.node.count_publishers(TOPIC) == 0
