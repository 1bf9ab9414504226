#!/usr/bin/env python3
"""Evaluates many bags with `tanker_pose evaluate`, on the cores of this machine or on a cluster of Dask.

    python3 examples/fleet/evaluate_bags.py flights/ -o reports
    python3 examples/fleet/evaluate_bags.py flights/ more.txt -o reports --scheduler tcp://10.0.0.1:8786 -- --ros-args -r __ns:=/receiver

Needs distributed (from pip), but no ROS. Folders are searched for MCAP files and bags of rosbag2; a text file lists one bag a
line. Each bag gets a folder in the output, and summary.html and summary.json stand over all. With --scheduler, bags and output
must be at the same paths on all machines (a shared file system). A lost worker is survived: its bags go to others. Exit code: 0 if
all was read, 1 if something could not be read or used, 2 if nothing could be evaluated.
"""

import argparse
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import dask
from distributed import Client, LocalCluster, as_completed

WHOLE, IN_PART, NOTHING = 0, 1, 2
# Words of a failure that are kept.
MOST_WORDS = 2000


@dataclass
class Done:
    """What became of a bag."""

    name: str
    code: int
    words: str
    taken_s: float


def evaluate(program: str, bag: str, folder: str, arguments: list[str], limit_s: float) -> Done:
    """Runs on a worker: evaluates one bag into its folder."""
    begin = time.monotonic()
    command = [program, "evaluate", bag, "-o", folder, *arguments]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=limit_s,
            check=False,
        )
        code, words = done.returncode, done.stderr
    except subprocess.TimeoutExpired:
        code, words = NOTHING, f"not finished after {limit_s} s"
    name = Path(folder).name
    return Done(name, code, words[-MOST_WORDS:].strip(), time.monotonic() - begin)


def bags_in(path: Path) -> list[Path]:
    """The bags at a path: itself, those of a folder, or those that a text file lists."""
    if path.is_file() and path.suffix == ".txt":
        lines = path.read_text(encoding="utf-8").splitlines()
        return [path.parent / line.strip() for line in lines if line.strip()]
    if not path.is_dir() or (path / "metadata.yaml").is_file():
        return [path]
    folders = {found.parent for found in path.rglob("metadata.yaml")}
    files = [found for end in ("*.mcap", "*.db3") for found in path.rglob(end)]
    return sorted(folders | {found for found in files if found.parent not in folders})


def named(bags: list[Path]) -> dict[str, Path]:
    """A folder's name for each bag: its stem, with parts of its path where stems are the same."""
    found: dict[str, Path] = {}
    for bag in dict.fromkeys(bag.resolve() for bag in bags):
        parts = [*bag.parent.parts[1:], bag.stem]
        # Longer names until one is free: paths differ, so one is.
        names = ("__".join(parts[-count:]) for count in range(1, len(parts) + 1))
        name = next((name for name in names if name not in found), f"{bag.name}_{len(found)}")
        found[name] = bag
    return found


def parsed() -> tuple[argparse.Namespace, list[str]]:
    """The options, and what follows `--` for the program."""
    own, passed = sys.argv[1:], list[str]()
    if "--" in own:
        at = own.index("--")
        own, passed = own[:at], own[at + 1 :]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bags", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("evaluation"))
    parser.add_argument("--program", default="tanker_pose", help="on every worker")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, help="on this machine; default: one for each core")
    where.add_argument("--scheduler", help="address of a running scheduler of Dask")
    parser.add_argument("--limit-s", type=float, default=3600.0, help="for one bag")
    parser.add_argument("--resume", action="store_true", help="keep reports that are there")
    return parser.parse_args(own), passed


def client_of(options: argparse.Namespace) -> Client:
    """The workers."""
    if options.scheduler:
        return Client(options.scheduler)
    cluster = LocalCluster(
        n_workers=options.workers,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=None,
    )
    return Client(cluster)


def run(client: Client, jobs: dict[str, Path], options: argparse.Namespace, passed: list[str]) -> list[Done]:
    """Evaluates all bags; the results in the order in which they came."""
    output = options.output.resolve()
    limits = (passed, options.limit_s)
    names = {
        client.submit(evaluate, options.program, str(bag), str(output / name), *limits, pure=False): name
        for name, bag in jobs.items()
    }
    done: list[Done] = []
    for future in as_completed(names):
        name = names.pop(future)
        try:
            result = future.result()
        except Exception as error:  # Of a worker: all kinds, and the other bags go on.
            result = Done(name, NOTHING, f"{type(error).__name__}: {error}", 0.0)
        done.append(result)
        if result.code == NOTHING:
            folder = output / name
            folder.mkdir(parents=True, exist_ok=True)
            if not (folder / "evaluation.json").is_file():
                (folder / "failure.txt").write_text(result.words + "\n", encoding="utf-8")
        words = f": {result.words}" if result.code != WHOLE else ""
        print(f"{len(done)}/{len(jobs)} {name} ({result.taken_s:.2f} s){words}", flush=True)
    return done


def main() -> int:
    options, passed = parsed()
    jobs = named([bag for path in options.bags for bag in bags_in(path)])
    if options.resume:
        there = {name for name in jobs if (options.output / name / "evaluation.json").is_file()}
        print(f"{len(there)} reports are there already")
        jobs = {name: bag for name, bag in jobs.items() if name not in there}
    # A bag that ends three workers in a row is given up, not the whole run.
    with dask.config.set({"distributed.scheduler.allowed-failures": 3}), client_of(options) as client:
        done = run(client, jobs, options, passed)
    command = [options.program, "evaluate", "--reports", str(options.output), "-o", str(options.output)]
    summary = subprocess.run(command, check=False).returncode
    codes = {result.code for result in done} | {summary}
    if summary == NOTHING:
        return NOTHING
    return WHOLE if codes == {WHOLE} else IN_PART


if __name__ == "__main__":
    sys.exit(main())
