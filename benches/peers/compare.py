"""Drives the workers of the peers benchmark and writes its page.

compare.py --frames FILE [--rounds N] [--output FILE] -- WORKER ...

In each round every method solves every frame of a size in one block of a few milliseconds; the
order of the methods turns from round to round. Ratios are taken within a round, where both saw the
same machine, and their median is reported.
"""

import argparse
import datetime
import importlib.metadata
import platform
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frames import Array, Frame, read

REPOSITORY = Path(__file__).resolve().parents[2]
OURS_PRIOR = "ours_prior_ml"
OURS_GLOBAL = "ours_global_ml"
CALLS = {"py_cv": "call_opencv", "py_poselib": "call_poselib"}
# rad; farther off than any noise of half a pixel turns a pose: another minimum.
WRONG_RAD = 0.2


@dataclass(frozen=True)
class Method:
    name: str
    what: str
    starts_from: str
    gives: str


NONE, PRIOR = "nothing", "prior"
METHODS = [
    Method(OURS_PRIOR, "**tanker_pose**, maximum likelihood", PRIOR, "ML, covariance, test"),
    Method("ours_prior_oi", "**tanker_pose**, orthogonal iteration", PRIOR, "OI, covariance, test"),
    Method(OURS_GLOBAL, "**tanker_pose**, maximum likelihood", NONE, "ML, covariance, test"),
    Method("ours_global_oi", "**tanker_pose**, orthogonal iteration", NONE, "OI, covariance, test"),
    Method("ours_literal_oi", "the paper's iteration, step by step", PRIOR, "OI"),
    Method("authors_sqpnp", "SQPnP by its authors, C++", NONE, "algebraic"),
    Method("crate_sqpnp", "crate `sqpnp`, Rust, f32 in and out", NONE, "algebraic"),
    Method("cv_sqpnp", "OpenCV `SQPNP`, C++", NONE, "algebraic"),
    Method("cv_epnp", "OpenCV `EPNP`, C++", NONE, "algebraic"),
    Method("cv_iterative", "OpenCV `ITERATIVE`, C++", PRIOR, "ML"),
    Method("cv_sqpnp_lm", "OpenCV `SQPNP`, `solvePnPRefineLM`, C++", NONE, "ML"),
    Method("cv_sqpnp_lm_cov", "the same with a covariance, C++", NONE, "ML, covariance"),
    Method("py_poselib", "PoseLib `refine_absolute_pose`, Python call", PRIOR, "ML"),
    Method("py_cv_sqpnp", "OpenCV `SQPNP`, Python call", NONE, "algebraic"),
    Method("py_cv_epnp", "OpenCV `EPNP`, Python call", NONE, "algebraic"),
    Method("py_cv_iterative", "OpenCV `ITERATIVE`, Python call", PRIOR, "ML"),
    Method("py_cv_sqpnp_lm", "OpenCV `SQPNP`, `solvePnPRefineLM`, Python calls", NONE, "ML"),
]


class Worker:
    """A process that solves the frames on demand."""

    def __init__(self, command: str) -> None:
        self._child = subprocess.Popen(
            shlex.split(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.methods = self.ask("methods").split()

    def ask(self, line: str) -> str:
        assert self._child.stdin and self._child.stdout
        self._child.stdin.write(f"{line}\n")
        self._child.stdin.flush()
        return self.read()

    def read(self) -> str:
        assert self._child.stdout
        answer = self._child.stdout.readline()
        if not answer:
            sys.exit("peers: a worker ended early")
        return answer.strip()

    def poses(self, method: str, size: int, count: int) -> list[Array | None]:
        rows = [self.ask(f"poses {method} {size}")] + [self.read() for _ in range(count - 1)]
        return [None if row == "none" else np.array(row.split(), dtype=float) for row in rows]

    def close(self) -> None:
        assert self._child.stdin
        self._child.stdin.close()
        self._child.wait()


@dataclass(frozen=True)
class Accuracy:
    """Errors against the truth, over the frames that were solved in the right minimum."""

    rms_mrad: float
    rms_cm: float
    failed: int
    wrong: int


def accuracy(poses: list[Array | None], frames: list[Frame]) -> Accuracy:
    angles, distances, failed = [], [], 0
    for pose, frame in zip(poses, frames, strict=True):
        if pose is None:
            failed += 1
            continue
        turn = pose[:9].reshape(3, 3) @ frame.truth_rotation.T
        sine = np.linalg.norm(turn - turn.T) / np.sqrt(8)
        angles.append(np.arctan2(sine, (np.trace(turn) - 1) / 2))
        distances.append(np.linalg.norm(pose[9:] - frame.truth_translation))
    angles, distances = np.array(angles), np.array(distances)
    right = angles < WRONG_RAD

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(values[right] ** 2)))

    return Accuracy(1e3 * rms(angles), 1e2 * rms(distances), failed, int((~right).sum()))


def measure(workers: list[Worker], sizes: int, rounds: int) -> dict[str, Array]:
    """ns per solve of every method, [size, round]."""
    order = [(worker, method) for worker in workers for method in worker.methods]
    times = {method: np.zeros((sizes, rounds)) for _, method in order}
    for turn in range(rounds):
        print(f"\rpeers: round {turn + 1} of {rounds}", end="", file=sys.stderr, flush=True)
        # Turned by a step that shares no factor with most counts, every other round backwards.
        start = (5 * turn) % len(order)
        rotated = order[start:] + order[:start]
        for size in range(sizes):
            for worker, method in rotated if turn % 2 == 0 else reversed(rotated):
                times[method][size, turn] = float(worker.ask(f"time {method} {size}"))
    print(file=sys.stderr)
    return times


def microseconds(nanoseconds: float) -> str:
    value = nanoseconds / 1e3
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def factor(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def ratio(times: dict[str, Array], method: str, to: str, size: int) -> str:
    return factor(float(np.median(times[method][size] / times[to][size])))


def ratio_and_net(times: dict[str, Array], method: str, to: str, size: int) -> str:
    """The ratio, for Python calls also without what the calls alone cost."""
    text = ratio(times, method, to, size)
    if call := call_of(method):
        count = 2 if method == "py_cv_sqpnp_lm" else 1
        net = times[method][size] - count * times[call][size]
        text += f" ({factor(float(np.median(net / times[to][size])))})"
    return text


def call_of(method: str) -> str | None:
    """What measures a Python call that does next to nothing; none for other methods."""
    return next((call for prefix, call in CALLS.items() if method.startswith(prefix)), None)


def table(times: dict[str, Array], found: dict[tuple[str, int], Accuracy], size: int) -> list[str]:
    lines = [
        "| method | starts from | gives | median µs | min µs | × ours, prior | × ours, none "
        "| RMS mrad | RMS cm | failed, wrong |",
        "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for method in METHODS:
        if method.name not in times:
            continue
        series, errors = times[method.name][size], found[method.name, size]
        lines.append(
            f"| {method.what} | {method.starts_from} | {method.gives} "
            f"| {median_us(times, method.name, size)} | {microseconds(float(series.min()))} "
            f"| {ratio_and_net(times, method.name, OURS_PRIOR, size)} "
            f"| {ratio_and_net(times, method.name, OURS_GLOBAL, size)} "
            f"| {errors.rms_mrad:.3f} | {errors.rms_cm:.3f} "
            f"| {errors.failed}, {errors.wrong} |"
        )
    return lines


def median_us(times: dict[str, Array], method: str, size: int) -> str:
    """The median, for a Python call with what the call alone costs."""
    text = microseconds(float(np.median(times[method][size])))
    if call := call_of(method):
        text += f" (call {microseconds(float(np.median(times[call][size])))})"
    return text


def summary(times: dict[str, Array], points: list[int]) -> list[str]:
    """Ours against the fastest SQPnP and the fastest maximum likelihood, at each size."""
    peers = [m for m in METHODS if m.name in times and not m.name.startswith("ours")]
    groups = (
        [m for m in peers if m.name.endswith("sqpnp")],
        [m for m in peers if m.gives.startswith("ML")],
    )
    lines = [
        "| n | ours, prior, µs | ours, none, µs "
        "| fastest SQPnP | µs | over ours: prior, none "
        "| fastest ML peer | µs | over ours: prior, none |",
        "| ---: | ---: | ---: | --- | ---: | --- | --- | ---: | --- |",
    ]
    for size, n in enumerate(points):
        cells = [str(n), median_us(times, OURS_PRIOR, size), median_us(times, OURS_GLOBAL, size)]
        for group in groups:
            best = min(group, key=lambda m: float(np.median(times[m.name][size])))
            cells += [
                best.what,
                median_us(times, best.name, size),
                f"{ratio(times, best.name, OURS_PRIOR, size)}, "
                f"{ratio(times, best.name, OURS_GLOBAL, size)}",
            ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def first_line(*command: str) -> str:
    if shutil.which(command[0]) is None:
        return "none"
    result = subprocess.run(command, capture_output=True, text=True, check=True, cwd=REPOSITORY)
    return result.stdout.splitlines()[0]


def cpu() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def versions(workers: list[Worker]) -> str:
    found = [
        f"commit {first_line('git', 'rev-parse', '--short', 'HEAD')} of tanker_pose"
        + (" with changes" if uncommitted() else ""),
        first_line("rustc", "--version").split(" (")[0],
        "crate sqpnp 0.4.0",
    ]
    for package in ("opencv-python-headless", "poselib", "numpy"):
        found.append(f"{package} {importlib.metadata.version(package)} (pip)")
    for worker in workers:
        if "cv_sqpnp" in worker.methods:
            found.append(f"{worker.ask('version')} (C++, the distribution's package)")
            found.append(first_line("g++", "--version"))
    return "; ".join(found)


def uncommitted() -> bool:
    command = ["git", "diff", "--quiet", "HEAD", "--", "src", "Cargo.toml", "Cargo.lock"]
    return subprocess.run(command, cwd=REPOSITORY, check=False).returncode != 0


def page(
    workers: list[Worker],
    times: dict[str, Array],
    found: dict[tuple[str, int], Accuracy],
    points: list[int],
    counts: list[int],
) -> str:
    rounds = next(iter(times.values())).shape[1]
    # A peer that was not measured is named, not passed over.
    missing = [m.what for m in METHODS if m.name not in times]
    tables = []
    for size, n in enumerate(points):
        tables += [f"### n = {n}", "", *table(times, found, size), ""]
    return (
        (Path(__file__).parent / "page.md")
        .read_text(encoding="utf-8")
        .replace("@SUMMARY@", "\n".join(summary(times, points)))
        .replace("@TABLES@", "\n".join(tables).rstrip())
        .replace("@WRONG@", f"{WRONG_RAD:g} rad")
        .replace("@FRAMES@", ", ".join(str(count) for count in counts))
        .replace("@ROUNDS@", str(rounds))
        .replace("@CPU@", cpu())
        .replace("@DATE@", f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}")
        .replace("@VERSIONS@", versions(workers))
        .replace("@MISSING@", "; ".join(missing) or "nothing")
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=Path, required=True)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--output", type=Path, default=REPOSITORY / "docs" / "benchmarks.md")
    parser.add_argument("workers", nargs="+")
    arguments = parser.parse_args()
    _, sizes = read(arguments.frames)
    points = [len(frames[0].markers) for frames in sizes]
    workers = [Worker(command) for command in arguments.workers]
    found = {
        (method, size): accuracy(worker.poses(method, size, len(frames)), frames)
        for worker in workers
        for method in worker.methods
        if not method.startswith("call_")
        for size, frames in enumerate(sizes)
    }
    times = measure(workers, len(sizes), arguments.rounds)
    text = page(workers, times, found, points, [len(frames) for frames in sizes])
    for worker in workers:
        worker.close()
    arguments.output.write_text(text, encoding="utf-8")
    print(f"peers: wrote {arguments.output}", file=sys.stderr)


if __name__ == "__main__":
    main()
