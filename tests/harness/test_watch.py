"""`tanker_pose watch` beside the real node: what it prints is what the node says."""

import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import termios
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from harness import messages
from harness.conftest import StartEstimator, StartNode
from harness.estimator import Answer, Estimator, Topics
from harness.peer import Peer
from harness.processes import Process, binary, child_environment, started
from harness.waiting import PATIENCE_S, wait_until

NAMESPACE = "/receiver"
# Half of the last digit printed, m.
PRINTED_ROUNDING = 5.1e-4
# One line a second.
PERIOD_S = 1.0

StartWatch = Callable[..., Process]

POSITION = re.compile(
    r"right (?P<right>\S+) ±(?P<right_sigma>[\d.]+), down (?P<down>\S+) ±(?P<down_sigma>[\d.]+), "
    r"ahead (?P<ahead>\S+) ±(?P<ahead_sigma>[\d.]+) m \| roll (?P<roll>\S+) "
)


@pytest.fixture
def start_watch(domain: int, tmp_path: Path) -> Iterator[StartWatch]:
    """Starts the tool; in the end all that still run must leave with code 0."""
    with started() as tools:

        def start(*arguments: str) -> Process:
            command = [str(binary("tanker_pose")), "watch", *arguments]
            tools.append(Process(command, domain, tmp_path / f"watch_{len(tools)}", {}))
            return tools[-1]

        yield start


def lines(watch: Process) -> list[str]:
    """The complete lines about moments, without those about what is listened to."""
    complete = watch.log.rpartition("\n")[0].splitlines()
    return [line for line in complete if re.match(r"[\d.]+ s \| ", line)]


def ask_until(
    estimator: Estimator,
    watch: Process,
    make_frame: Callable[[int], object],
    words: Callable[[Answer], list[str]],
) -> tuple[str, Answer]:
    """Sends frames until a line holds what the answers to them say; returns both."""
    answers: list[Answer] = []

    def matching() -> str | None:
        for line in lines(watch):
            if answers and all(word in line for word in words(answers[-1])):
                return line
        return None

    wait_until(
        lambda: matching() is not None,
        "a line of watch with what the node answers",
        pause=lambda: answers.append(estimator.ask(make_frame(estimator.next_index()))),
    )
    line = matching()
    assert line is not None
    return line, answers[-1]


def too_few(index: int) -> object:
    frame = messages.exact_frame(index)
    frame.points = frame.points[:4]
    return frame


def one_wrong(index: int) -> object:
    frame = messages.exact_frame(index)
    frame.points[2].u += 40.0
    return frame


def test_a_pose_is_shown_with_its_sigmas_and_what_it_rests_on(
    estimator: Estimator, start_watch: StartWatch
) -> None:
    watch = start_watch()

    line, answer = ask_until(
        estimator, watch, messages.exact_frame, lambda answer: ["| OK | right", "track UPDATED"]
    )

    shown = POSITION.search(line)
    assert shown and answer.pose is not None, line
    position = answer.pose.pose.pose.position
    sigmas = np.sqrt(np.diag(messages.covariance_of(answer.pose)))
    truth = {"right": (position.x, sigmas[0]), "down": (position.y, sigmas[1]), "ahead": (position.z, sigmas[2])}
    for axis, (value, sigma) in truth.items():
        assert float(shown[axis]) == pytest.approx(value, abs=PRINTED_ROUNDING)
        assert float(shown[f"{axis}_sigma"]) == pytest.approx(sigma, abs=PRINTED_ROUNDING)
    assert re.search(r"age \d\.\d\d s \| used 6, left out 0 \| chi2/dof 0\.\d\d", line), line
    assert "watching /tanker_pose in domain" in watch.log
    assert "/pose, /status, /odometry, /diagnostics" in watch.log


def test_a_marker_that_is_left_out_is_named(estimator: Estimator, start_watch: StartWatch) -> None:
    watch = start_watch()

    # In frame after frame that is no wrong detection any more: then the marker is named as the reason.
    line, answer = ask_until(
        estimator,
        watch,
        one_wrong,
        lambda answer: ["| OK |", "used 5, left out 3"]
        if answer.outcome == "OK"
        else ["NOT_TRUSTED", "marker 3 was left out"],
    )

    assert answer.outcome in {"OK", "NOT_TRUSTED"}, answer.status.message
    assert "left out 3" in line or "marker 3 was left out" in line, line


def test_a_refusal_is_shown_with_its_reason_and_no_old_pose_beside_it(
    estimator: Estimator, start_watch: StartWatch
) -> None:
    watch = start_watch()
    ask_until(estimator, watch, messages.exact_frame, lambda answer: ["| OK | right"])

    line, _ = ask_until(
        estimator,
        watch,
        too_few,
        lambda answer: [f"TOO_FEW_POINTS: {answer.status.message}", "no pose for"],
    )

    assert not POSITION.search(line), line


def test_a_fault_is_shown_by_its_key_and_in_the_words_of_the_node(
    start_estimator: StartEstimator, start_watch: StartWatch
) -> None:
    estimator = start_estimator()
    watch = start_watch()

    line, _ = ask_until(
        estimator,
        watch,
        messages.exact_frame,
        lambda answer: [f"NO_CAMERA_INFO: {answer.status.message}", "faults: no_camera_info: "],
    )

    assert "no pose yet" in line


def test_a_node_without_detections_is_told_from_no_node(
    start_node: StartNode, start_watch: StartWatch
) -> None:
    watch = start_watch()
    wait_until(lambda: "no tanker_pose node in domain" in watch.log, "the tool to say that there is no node")

    node = start_node()
    wait_until(
        lambda: "answered no frame" in watch.log and "no feature_points: no publisher" in watch.log,
        "the tool to say that nothing comes to the node",
    )
    node.stop()
    wait_until(lambda: "/tanker_pose has left domain" in watch.log, "the tool to say that the node has left")


@pytest.mark.parametrize("option", ["--seconds=1.5", "--once"])
def test_without_a_node_it_ends_in_time_and_says_what_is_missing(
    start_watch: StartWatch, domain: int, option: str
) -> None:
    watch = start_watch(option, "--seconds=1.5") if option == "--once" else start_watch(option)

    code = watch.wait()

    assert code == (1 if option == "--once" else 0)
    assert f"no tanker_pose node in domain {domain}" in watch.log
    assert f"ROS_DOMAIN_ID={domain}" in watch.log


def test_once_prints_one_line_with_a_pose(estimator: Estimator, start_watch: StartWatch) -> None:
    watch = start_watch("--once", f"--seconds={PATIENCE_S}")

    wait_until(
        lambda: not watch.running,
        "the tool to end",
        pause=lambda: estimator.expect_pose(messages.exact_frame(estimator.next_index())),
    )

    assert watch.wait() == 0, watch.log
    (line,) = watch.log.splitlines()
    assert POSITION.search(line), line


def test_renamed_topics_are_found_and_of_several_nodes_one_is_chosen(
    start_estimator: StartEstimator, start_node: StartNode, start_watch: StartWatch, peer: Peer
) -> None:
    topics = Topics(**(vars(Topics().under(NAMESPACE)) | {"pose": "/guidance/tanker"}))
    estimator = start_estimator("-r", f"__ns:={NAMESPACE}", "-r", "pose:=/guidance/tanker", topics=topics)
    estimator.use_camera()
    start_node("-r", "__ns:=/other")
    peer.spin_until(lambda: peer.sees_node("/other/tanker_pose"), "the other node to be in the graph")

    undecided = start_watch("--seconds=10")
    assert undecided.wait() == 1
    for word in ("/receiver/tanker_pose", "/other/tanker_pose", "--node"):
        assert word in undecided.log, undecided.log

    for arguments in (
        ["--node", f"{NAMESPACE}/tanker_pose"],
        ["--ros-args", "-r", f"__ns:={NAMESPACE}"],
    ):
        watch = start_watch(*arguments)
        ask_until(estimator, watch, messages.exact_frame, lambda answer: ["| OK | right"])
        assert f"watching {NAMESPACE}/tanker_pose in domain" in watch.log
        assert "/guidance/tanker, /receiver/status" in watch.log
        watch.stop()


def test_a_node_that_is_not_the_one_asked_for_is_named(
    start_node: StartNode, start_watch: StartWatch
) -> None:
    start_node("-r", f"__ns:={NAMESPACE}")
    watch = start_watch("--node", "/elsewhere/tanker_pose")

    wait_until(
        lambda: re.search(
            r"no node /elsewhere/tanker_pose in domain .* among them /receiver/tanker_pose", watch.log
        ),
        "the tool to say which node is there instead",
    )


def test_a_parameter_is_refused(start_watch: StartWatch) -> None:
    watch = start_watch("--ros-args", "-p", "seconds:=3")

    assert watch.wait() == 1
    assert 'no parameter "seconds"' in watch.log


def test_on_a_terminal_a_table_is_drawn_in_place_and_ctrl_c_gives_the_cursor_back(
    estimator: Estimator, domain: int, tmp_path: Path
) -> None:
    terminal, its_end = pty.openpty()
    fcntl.ioctl(its_end, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 100, 0, 0))
    os.set_blocking(terminal, False)
    environment = child_environment(domain) | {"TERM": "xterm"}
    command = [str(binary("tanker_pose")), "watch"]
    # The middleware may log a line at any moment, the last one included: that is not the table's.
    with (tmp_path / "watch.stderr").open("wb") as log:
        watch = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=its_end, stderr=log, env=environment
        )
    drawn = b""

    def read() -> None:
        nonlocal drawn
        try:
            drawn += os.read(terminal, 1 << 16)
        except BlockingIOError:
            pass

    def fly() -> None:
        estimator.expect_pose(messages.exact_frame(estimator.next_index()))
        read()

    try:
        wait_until(
            lambda: drawn.count(b"used 6, left out 0") > 3, "four tables with a pose", pause=fly
        )
        watch.send_signal(signal.SIGINT)
        wait_until(lambda: watch.poll() is not None, "the tool to end", pause=read)
        read()
    finally:
        if watch.poll() is None:
            watch.kill()
        watch.wait()
        os.close(terminal)
        os.close(its_end)

    assert watch.returncode == 0
    text = drawn.decode()
    hidden, shown = "\x1b[?25l", "\x1b[?25h"
    assert text.count(hidden) == text.count(shown) == 1 and text.endswith(shown)
    # Each table begins where the one before began: as many lines up as that one had.
    first, *rest = re.split(r"\x1b\[(\d+)A(?:\r?\x1b\[2K\x1b\[1B)+\x1b\[\d+A", text)
    ups, tables = rest[::2], rest[1::2]
    assert len(tables) > 3
    for before, up in zip([first, *tables], ups, strict=False):
        assert int(up) == before.count("\n"), repr(before)
        assert "position" in before
