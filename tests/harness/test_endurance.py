"""Hours of work and a hundred restarts leave nothing behind: memory, threads and descriptors stay what they were.

`TANKER_POSE_SOAK_S` and `TANKER_POSE_RESTARTS` say how long and how often; the defaults are short, for every day.
"""

import os
import signal
import sys
import time
from pathlib import Path

import psutil

from harness import messages, paper
from harness.burden import MEBIBYTE, Burden
from harness.conftest import StartEstimator, StartNode
from harness.estimator import Estimator
from harness.peer import RELIABLE, Peer
from harness.processes import Process

SOAK_S = float(os.environ.get("TANKER_POSE_SOAK_S", "15"))
RESTARTS = int(os.environ.get("TANKER_POSE_RESTARTS", "12"))
RATE_HZ = 200
# What an allocator keeps back varies by this much; a leak of 100 bytes a frame shows within ten minutes.
MOST_GROWTH = 4 * MEBIBYTE
MOST_MEMORY = 30 * MEBIBYTE
EXIT_WITHIN_S = 1.0
DETECTOR = Path(__file__).parent / "fixtures" / "detector.py"


def test_frames_by_the_thousand_leave_memory_threads_and_descriptors_flat(
    start_estimator: StartEstimator,
) -> None:
    estimator = start_estimator(qos=RELIABLE)
    estimator.use_camera()
    fly(estimator, SOAK_S / 3)
    warm = Burden.of(estimator.process)
    busy_s = sum(psutil.Process(estimator.process.pid).cpu_times()[:2])
    count = fly(estimator, SOAK_S)
    busy_s = sum(psutil.Process(estimator.process.pid).cpu_times()[:2]) - busy_s
    end = Burden.of(estimator.process)

    print(f"{count} frames in {SOAK_S:g} s: from {warm} to {end}; {100 * busy_s / SOAK_S:.1f} % CPU")
    assert count > 0.5 * SOAK_S * RATE_HZ
    assert (end.threads, end.descriptors) == (warm.threads, warm.descriptors)
    assert end.memory - warm.memory < MOST_GROWTH
    assert end.memory < MOST_MEMORY


def fly(estimator: Estimator, duration_s: float) -> int:
    """Sends frames at a steady rate, one in a hundred of them spoilt, and returns how many; all are answered."""
    begin = time.monotonic()
    last = None
    count = 0
    while (now := time.monotonic()) - begin < duration_s:
        if (due := begin + count / RATE_HZ) > now:
            estimator.peer.spin_for(due - now)
        index = estimator.next_index()
        pixels = paper.marker_pixels(paper.POSE)
        if index % 100 == 0:
            pixels[2, 0] = float("nan")
        last = messages.feature_points(index, pixels)
        estimator.send(last)
        count += 1
        # What was heard is not what is measured.
        if count % 1000 == 0:
            estimator.poses.clear()
            estimator.statuses.clear()
    estimator.answer_to(last)
    return count


def test_restarts_of_the_node_are_fast_and_each_is_heard(
    start_node: StartNode, peer: Peer
) -> None:
    slowest_exit_s = 0.0
    estimator = None
    for _ in range(RESTARTS):
        node = start_node()
        # The peer stays what it was, as a flight stack does.
        estimator = estimator or Estimator(peer, node)
        estimator.process = node
        estimator.wait_until_heard()
        estimator.use_camera()
        estimator.expect_pose(messages.exact_frame(estimator.next_index()))
        begin = time.monotonic()
        node.send(signal.SIGINT)
        assert node.wait() == 0, node.log
        slowest_exit_s = max(slowest_exit_s, time.monotonic() - begin)
    print(f"{RESTARTS} restarts, slowest exit {slowest_exit_s:.3f} s")
    assert slowest_exit_s < EXIT_WITHIN_S


def test_detectors_that_are_killed_and_come_back_are_heard_and_leave_nothing(
    start_node: StartNode, peer: Peer, domain: int, tmp_path: Path
) -> None:
    node = start_node()
    estimator = Estimator(peer, node)
    estimator.wait_until_heard()
    warm = None
    for restart in range(RESTARTS):
        first = 1_000_000 * (restart + 1)
        command = [sys.executable, str(DETECTOR), str(domain), str(first)]
        detector = Process(command, domain, tmp_path / f"detector_{restart}", {})
        try:
            since = messages.key(messages.stamp_of(first))
            peer.spin_until(
                lambda since=since: any(stamp >= since for stamp in estimator.poses),
                f"a pose from detector {restart}",
            )
        finally:
            # It cannot say that it leaves: to the node it is there until its lease ends.
            detector.kill_if_running()
        if restart == RESTARTS // 3:
            warm = Burden.of(node)
    end = Burden.of(node)
    print(f"{RESTARTS} detectors: from {warm} to {end}")
    assert warm is not None
    assert (end.threads, end.descriptors) == (warm.threads, warm.descriptors)
    assert end.memory - warm.memory < MOST_GROWTH
