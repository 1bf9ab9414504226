"""Every input of the node, off, stuck, garbage, wrong, slow, delayed and intermittent: the node goes on, publishes no pose
that is wrong unless docs/faults.md says so, gives the reason, and recovers.

docs/faults.md is the table of these faults; TANKER_POSE_WRITE_DOCS=1 writes it.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness import detectors, injected_faults, paper
from harness.approach import SETUP
from harness.conftest import StartEstimator
from harness.injected_faults import KINDS, NONE, TRUE, WRONG_POSE, Cell
from harness.injection import LARGEST_NEES, LOCAL_M, Lane, Seen, as_it_is, nothing, truth
from harness.peer import Peer
from harness.processes import REPOSITORY

PAGE = REPOSITORY / "docs" / "faults.md"
# Frames until a node that has begun has heard all that belongs to them.
PATIENCE_FRAMES = 40

LOCAL = ("-p", f"refuelling:={SETUP}", "-p", "publish_mavros_pose:=true")
REPORTED = ("-p", "reported_attitude_sigma_deg:=2.0")


@dataclass(frozen=True)
class Input:
    """One input, with the node that has it and what is injected into it."""

    name: str
    type: str
    cells: list[Cell]
    arguments: tuple[str, ...] = ()
    lane: dict[str, Any] = field(default_factory=dict)

    @property
    def has_local(self) -> bool:
        return bool(self.cells[0].local)


def see_boxes(index: int, rng: np.random.Generator) -> Any:
    pixels = paper.marker_pixels(truth(index))
    return detectors.boxes(index, pixels + rng.normal(0.0, 0.3, pixels.shape))


def see_tags(index: int, rng: np.random.Generator) -> Any:
    return detectors.tags(index, truth(index), rng, sigma_px=0.3)


INPUTS = [
    Input("feature_points", "tanker_pose/FeaturePointArray", injected_faults.FEATURE_POINTS),
    Input(
        "detections",
        "vision_msgs/Detection2DArray",
        injected_faults.VISION,
        ("-p", "input:=detections"),
        {"detector": detectors.VISION, "detect": see_boxes},
    ),
    Input(
        "detections",
        "apriltag_msgs/AprilTagDetectionArray",
        injected_faults.APRILTAGS,
        ("-p", "input:=apriltags"),
        {"detector": detectors.APRILTAGS, "detect": see_tags},
    ),
    Input("camera_info", "sensor_msgs/CameraInfo", injected_faults.CAMERA_INFO),
    Input(
        "the receiver's attitude",
        "px4_msgs/VehicleAttitude",
        injected_faults.PX4_ATTITUDE,
        (*LOCAL, "-p", "attitude:=px4"),
        {"receiver": "px4"},
    ),
    Input(
        "the receiver's attitude",
        "sensor_msgs/Imu",
        injected_faults.IMU_ATTITUDE,
        (*LOCAL, "-p", "attitude:=imu"),
        {"receiver": "imu"},
    ),
    Input(
        "tanker_attitude",
        "sensor_msgs/Imu",
        injected_faults.TANKER_ATTITUDE,
        (*LOCAL, *REPORTED, "-p", "attitude:=imu"),
        {"receiver": "imu", "tanker": True},
    ),
    Input(
        "/clock",
        "rosgraph_msgs/Clock",
        injected_faults.CLOCK,
        ("-p", "use_sim_time:=true"),
        {"clock": True},
    ),
]


def is_well(lane: Lane, given: Input) -> bool:
    """Whether a good frame is answered as it should be."""
    # Apart from what was spoilt before by more than attitudes may be from their image.
    stride = injected_faults.APART if given.has_local else 1
    camera = as_it_is if given.name == "camera_info" else nothing
    seen = lane.run(1, camera=camera, stride=stride)
    if seen[0].outcome != "OK" or seen[0].nees > LARGEST_NEES or seen[0].answer.status.message:
        return False
    return not given.has_local or bool(lane.local_errors_m(seen))


def failings(lane: Lane, given: Input, cell: Cell) -> list[str]:
    """What is not as the cell says, while the fault lasts and after it."""
    seen = cell.inject(lane)
    found = []
    outcomes = {s.outcome for s in seen}
    if not outcomes <= {*cell.outcomes}:
        words = {s.answer.status.message for s in seen if s.outcome not in cell.outcomes}
        found.append(f"outcomes {outcomes}: {words}")
    if cell.outcomes != ("none",) and not seen:
        found.append("no answer")
    found += failings_of_poses(seen, cell)
    message = seen[-1].answer.status.message if seen else ""
    if cell.says not in message:
        found.append(f"says {message!r}")
    if given.has_local:
        found += failings_of_local(lane, cell, seen)
    if cell.fault[0]:
        name, words = cell.fault
        try:
            lane.wait_for_fault(name, words, lambda: cell.inject(lane))
        except AssertionError as error:
            found.append(str(error))
    good = 0
    while not is_well(lane, given):
        good += 1
        if good > PATIENCE_FRAMES:
            return [*found, "does not recover"]
    if good + 1 > cell.recovers:
        found.append(f"recovers with good frame {good + 1}, not {cell.recovers}")
    return found


def failings_of_poses(seen: list[Seen], cell: Cell) -> list[str]:
    poses = [s for s in seen if s.nees is not None]
    if cell.poses == TRUE:
        wrong = [round(s.nees) for s in poses if s.nees > LARGEST_NEES]
        return [f"wrong poses, NEES {wrong}"] if wrong else []
    if cell.poses == WRONG_POSE:
        # Noticed after all: the table has to say so.
        return [] if any(s.nees > LARGEST_NEES for s in poses) else ["no pose is wrong"]
    # Frames that may be right before the fault can show are those of outcome OK that the cell allows.
    if poses and "OK" not in cell.outcomes:
        return [f"{len(poses)} poses"]
    if "OK" in cell.outcomes and seen and seen[-1].outcome == "OK":
        return ["the fault does not show"]
    return []


def failings_of_local(lane: Lane, cell: Cell, seen: list[Seen]) -> list[str]:
    errors = lane.local_errors_m(seen)
    if cell.local == NONE:
        return [f"outputs in local axes, off by {np.round(errors, 2)} m"] if errors else []
    if not errors:
        return ["no output in local axes"]
    is_wrong = max(errors) > LOCAL_M
    if is_wrong != (cell.local == WRONG_POSE):
        return [f"outputs in local axes are off by {np.round(errors, 2)} m"]
    return []


@pytest.mark.parametrize("given", INPUTS, ids=lambda given: f"{given.name} {given.type}")
def test_no_fault_of_an_input_makes_a_wrong_output_that_the_table_does_not_admit(
    peer: Peer,
    start_estimator: StartEstimator,
    rng: np.random.Generator,
    tmp_path: Path,
    given: Input,
) -> None:
    arguments = given.arguments
    if given.type.startswith("apriltag"):
        marker_map = detectors.write_tag_map(tmp_path / "tags.yaml")
        arguments = (*arguments, "-p", f"marker_map:={marker_map}")
    lane = Lane(peer, start_estimator, rng, *arguments, **given.lane)
    ready(lane, given)

    found = {}
    for cell in given.cells:
        found[f"{cell.kind}: {cell.what}"] = failings(lane, given, cell)
        assert lane.estimator.process.running, f"{cell.what} ended the node"

    wrong = [f"{what}: {'; '.join(words)}" for what, words in found.items() if words]
    assert not wrong, "\n".join(wrong)
    assert "panicked" not in lane.estimator.process.log


def ready(lane: Lane, given: Input) -> None:
    for _ in range(PATIENCE_FRAMES):
        if is_well(lane, given):
            return
    raise AssertionError(f"no good answer to good frames:\n{lane.estimator.process.log}")


def test_a_camera_info_that_never_comes_is_the_reason_for_no_pose(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator
) -> None:
    lane = Lane(peer, start_estimator, rng, camera=False)
    assert {s.outcome for s in lane.run(5)} == {"NO_CAMERA_INFO"}


def test_a_reset_ends_a_contradiction_of_attitudes(
    peer: Peer, start_estimator: StartEstimator, rng: np.random.Generator
) -> None:
    (given,) = (given for given in INPUTS if given.name == "tanker_attitude")
    lane = Lane(peer, start_estimator, rng, *given.arguments, **given.lane)
    ready(lane, given)
    spoilt = injected_faults.silent_after_a_contradiction(lane)
    assert lane.local_errors_m(spoilt) == []
    lane.reset()
    errors = lane.local_errors_m(lane.run(4, tanker=lambda message, k: None, stride=injected_faults.FAR_APART))
    assert errors and max(errors) < LOCAL_M


HEAD = """# Faults of inputs

Written by `tests/harness/test_fault_injection.py`, which injects every fault below into the built node through rclpy and \
compares its answers with the truth of a synthetic scene (`TANKER_POSE_WRITE_DOCS=1` writes this page, and a test compares \
it). The kinds are those of PX4's failure injection. During and after each fault the node runs on; the next good message \
is answered, or the one after it where an attitude needs two samples.

- **outcome**: of the frames meanwhile; `none`: nothing is answered, because nothing arrives that can be.
- **pose**: `none`; `true`: as far from the truth as its covariance allows (honest errors exceed the bound once in 10⁸ frames); `wrong`: a pose is published, is \
trusted, and is not where the tanker is. **These are the faults that the node cannot notice.**
- **local**: the same of the outputs in local axes (PX4, ENU), which are turned by the receiver's attitude.

Faults of the graph and of quality of service are in [diagnostics](diagnostics.md).
"""


def page() -> str:
    lines = [HEAD]
    for given in INPUTS:
        lines += [f"## {given.name}: `{given.type}`", ""]
        if given.arguments:
            shown = [a for a in given.arguments if a != "-p" and not a.startswith("refuelling")]
            words = ", ".join(f"`{a.replace(':=', ': ')}`" for a in shown)
            lines += [f"With {words}.", ""]
        local = " local |" if given.has_local else ""
        lines += [f"| kind | fault | outcome | pose |{local} remarks |", "| --- | --- | --- | --- |" + " --- |" * (2 if local else 1)]
        lines += [row(cell, given) for cell in given.cells]
        lines.append("")
    return "\n".join(lines)


def row(cell: Cell, given: Input) -> str:
    outcomes = ", ".join(o if o == "none" else f"`{o}`" for o in cell.outcomes)
    remarks = [f"fault `{cell.fault[0]}`"] if cell.fault[0] else []
    remarks += [cell.note] if cell.note else []
    bold = {WRONG_POSE: f"**{WRONG_POSE}**"}
    local = f" {bold.get(cell.local, cell.local)} |" if given.has_local else ""
    pose = bold.get(cell.poses, cell.poses)
    return f"| {cell.kind} | {cell.what} | {outcomes} | {pose} |{local} {'; '.join(remarks)} |"


def test_the_page_about_faults_is_what_is_injected() -> None:
    if os.environ.get("TANKER_POSE_WRITE_DOCS"):
        PAGE.write_text(page(), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == page(), "TANKER_POSE_WRITE_DOCS=1 writes it"


def test_every_kind_of_fault_is_injected_somewhere() -> None:
    assert {cell.kind for given in INPUTS for cell in given.cells} == set(KINDS)
