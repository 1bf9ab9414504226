"""The examples do what they say: run as a user would, beside the real node, and ended by Ctrl-C."""

import json
import re
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.peer import RELIABLE, Peer
from harness.bags import read_bag
from harness.messages import key
from harness.processes import (
    REPOSITORY,
    Process,
    binary,
    child_environment,
    example,
    started,
)
from harness.test_bags import PATIENT
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
    with started(leave_well=False) as programs:

        def run(name: str, language: str) -> Process:
            programs.append(Process(command(name, language), domain, tmp_path / name, {}))
            return programs[-1]

        yield run


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


@pytest.mark.parametrize("name", ["pose_subscriber", "closing_speed"])
def test_ctrl_c_ends_a_program_in_python_well_whatever_it_is_doing(
    name: str, domain: int, tmp_path: Path
) -> None:
    # Each prints its imports, so that the moments begin after the last of them: until then Python has no way out but
    # a traceback.
    environment = {"PYTHONPROFILEIMPORTTIME": "1"}
    moments_s = [0.0, 0.02, 0.05, 0.1, 0.2, 0.4]
    with started(leave_well=False) as programs:
        for moment_s in moments_s:
            directory = tmp_path / f"{name}_{moment_s}"
            programs.append(Process(command(name, "python"), domain, directory, environment))
        for program, moment_s in zip(programs, moments_s, strict=True):
            wait_until(
                lambda: re.search(r"(?m)\| +tanker_pose\.msg$", program.log), "the imports"
            )
            time.sleep(moment_s)
            program.stop()
            assert "Traceback" not in program.log


def documented(program: str) -> str:
    """The one command of docs/bags.md that runs this program."""
    page = (REPOSITORY / "docs" / "bags.md").read_text(encoding="utf-8")
    (line,) = re.findall(rf"(?m)^.*examples/bags/{program} .*$", page)
    return line


def runnable(command: str) -> str:
    """The command with this environment's Python and the programs as they were built, for any directory."""
    return (
        command.replace("python3 ", f"{sys.executable} ")
        .replace("examples/bags/", f"{REPOSITORY}/examples/bags/")
        .replace("target/release/tanker_pose ", f"{binary('tanker_pose')} ")
    )


def test_the_road_by_bag_is_as_the_documents_say(
    start_node: StartNode, peer: Peer, domain: int, tmp_path: Path
) -> None:
    def run(program: str) -> str:
        command = runnable(documented(program))
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", command],
            cwd=tmp_path,
            env=child_environment(domain),
            capture_output=True,
            text=True,
            timeout=60.0,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout

    assert run("write_bag.py") == "wrote 90 frames\n"
    solved = [json.loads(line) for line in run("bag_to_solve.py").splitlines()]
    assert len(solved) == 90
    assert {frame["outcome"] for frame in solved} == {"ok"}
    # The truth behind the pixels of the example, which are rounded to 0.1 px.
    assert solved[0]["translation"] == pytest.approx([0.0, -4.5, 15.0], abs=0.01)

    start_node(*PATIENT)
    peer.spin_until(lambda: peer.sees_node("/tanker_pose"), "the node to be in the graph")
    words = runnable(documented("record_bag.py")).split()
    words[2] = str(tmp_path / words[2])
    recorder = Process(words, domain, tmp_path / "recorder", {})
    try:
        wait_until(
            lambda: all(f"recording {topic}" in recorder.log for topic in ("/pose", "/status")),
            "the recorder to find the topics",
        )
        assert "played 180 messages" in run("play_bag.py")
        peer.spin_for(0.5)  # what is under way has arrived
        recorder.stop()
    finally:
        recorder.kill_if_running()
        print(recorder.log)

    answers = read_bag(tmp_path / "answers")
    assert [status.message for status in answers["/status"] if status.outcome] == []
    assert len(answers["/status"]) == len(answers["/pose"]) == 90
    by_stamp = {tuple(map(int, frame["id"].split("."))): frame for frame in solved}
    for pose in answers["/pose"]:
        found = pose.pose.pose.position
        assert [found.x, found.y, found.z] == pytest.approx(
            by_stamp[key(pose.header.stamp)]["translation"], abs=1e-9
        )


def test_the_page_about_bags_registers_the_types_as_the_example_does() -> None:
    page = (REPOSITORY / "docs" / "bags.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    program = (REPOSITORY / "examples" / "bags" / "tanker_types.py").read_text(encoding="utf-8")
    assert textwrap.indent(shown, "    ") in program
