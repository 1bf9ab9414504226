"""The examples do what they say: run as a user would, beside the real node, and ended by Ctrl-C."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.peer import RELIABLE, Peer
from harness.processes import REPOSITORY, Process, example
from harness.waiting import wait_until

LANGUAGES = ["python", "rust"]


def command(name: str, language: str) -> list[str]:
    """How the example is started."""
    if language == "rust":
        return [str(example(name))]
    return [sys.executable, str(REPOSITORY / "examples" / f"{name}.py")]


@pytest.fixture
def run_example(domain: int, tmp_path: Path) -> Iterator:
    """Starts examples; none outlives the test."""
    started: list[Process] = []

    def run(name: str, language: str) -> Process:
        started.append(Process(command(name, language), domain, tmp_path / name, {}))
        return started[-1]

    yield run
    for process in started:
        process.kill_if_running()
        print(f"--- {process.name} ---\n{process.log}")


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_subscriber_tells_poses_refusals_left_out_markers_and_silence(
    start_estimator: StartEstimator, run_example, language: str
) -> None:
    estimator = start_estimator(qos=RELIABLE)
    estimator.use_camera()
    subscriber = run_example("pose_subscriber", language)

    def heard(pattern: str) -> bool:
        return re.search(pattern, subscriber.log) is not None

    def good() -> None:
        estimator.expect_pose(messages.exact_frame(estimator.next_index()))

    def one_wrong() -> None:
        frame = messages.exact_frame(estimator.next_index())
        frame.points[2].u += 40.0
        estimator.expect_pose(frame)

    def too_few() -> None:
        frame = messages.exact_frame(estimator.next_index())
        frame.points = frame.points[:4]
        said.append(estimator.ask(frame).status.message)

    said: list[str] = []
    wait_until(lambda: heard(r"1\d\.\d\d m ahead, sigma 0\.\d\d m"), "a pose", pause=good)
    wait_until(lambda: heard(r"left out as wrong: \[3\]"), "a marker left out", pause=one_wrong)
    wait_until(lambda: heard(r"no pose \(10\): "), "a refusal", pause=too_few)
    assert f"no pose (10): {said[0]}" in subscriber.log
    wait_until(lambda: heard(r"no pose for [2-9] s"), "the silence")

    subscriber.stop()
    assert "Traceback" not in subscriber.log


@pytest.mark.parametrize("language", LANGUAGES)
def test_without_receptacle_the_closing_speed_says_what_is_missing(
    start_node: StartNode, peer: Peer, run_example, domain: int, language: str
) -> None:
    closing = run_example("closing_speed", language)

    def expect(words: str) -> None:
        wait_until(lambda: words in closing.log, f"the example to say: {words}")

    expect(f"nothing on /receptacle: no tanker_pose node is in domain {domain}")
    node = start_node()
    expect("a tanker_pose node is there, but does not publish it. Start the node with -p publish_receptacle:=true")
    node.stop()
    start_node(
        *("-p", "publish_receptacle:=true"),
        *("-p", f"refuelling:={REPOSITORY / 'config' / 'refuelling' / 'example.yaml'}"),
    )
    expect("it has a publisher, so the node has no confirmed track")
    closing.stop()
