"""Many bags over workers of Dask: one report over all, also when a worker is lost."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

from harness.processes import REPOSITORY, binary, child_environment
from harness.waiting import wait_until

BAGS = 5
SCRIPT = REPOSITORY / "examples" / "fleet" / "evaluate_bags.py"
# The first evaluation of each bag waits until it is allowed on: so a worker can be lost in the middle of one.
PROGRAM = """#!/bin/sh
case "$*" in
  *" --reports "*) ;;
  *) echo "$PPID" > "{folder}/started/$$"
     while [ ! -e "{folder}/go" ]; do sleep 0.05; done ;;
esac
exec "{tool}" "$@"
"""


def tool(*arguments: str | Path) -> None:
    """Runs the tool."""
    command = [str(binary("tanker_pose")), *map(str, arguments)]
    subprocess.run(command, env=child_environment(), check=True, timeout=60.0, capture_output=True)


def write_bags(folder: Path) -> list[Path]:
    """Short approaches with the node's answers."""
    bags = []
    for seed in range(1, BAGS + 1):
        approach, bag = folder / f"approach_{seed}.mcap", folder / "bags" / f"flight_{seed}.mcap"
        bag.parent.mkdir(exist_ok=True)
        tool("simulate", "--bag", approach, "--seed", str(seed), "--duration-s", "2")
        tool("replay", approach, "-o", bag)
        bags.append(bag)
    return bags


def test_a_lost_worker_costs_no_bag_and_the_summary_is_that_of_one_call(tmp_path: Path) -> None:
    bags = write_bags(tmp_path)
    (tmp_path / "started").mkdir()
    program = tmp_path / "program"
    program.write_text(PROGRAM.format(folder=tmp_path, tool=binary("tanker_pose")), encoding="utf-8")
    program.chmod(0o755)
    options = ["-o", str(tmp_path / "fleet"), "--workers", "2", "--program", str(program)]
    child = subprocess.Popen(
        [sys.executable, str(SCRIPT), str(tmp_path / "bags"), *options],
        env=child_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        # Both workers are in the middle of a bag.
        started = tmp_path / "started"
        wait_until(lambda: len(list(started.iterdir())) >= 2, "both workers to begin", timeout_s=40.0)
        workers = {int(path.read_text()) for path in started.iterdir() if path.read_text().strip()}
        os.kill(workers.pop(), signal.SIGKILL)
        (tmp_path / "go").touch()
        printed, _ = child.communicate(timeout=60.0)
    finally:
        child.kill()
    assert child.returncode == 0, printed
    tool("evaluate", *bags, "-o", tmp_path / "alone")
    fleet, alone = (
        json.loads((tmp_path / name / "summary.json").read_text(encoding="utf-8"))
        for name in ("fleet", "alone")
    )
    assert len(fleet["bags"]) == BAGS and fleet["failed"] == []
    assert fleet == alone
    for bag in bags:
        assert (tmp_path / "fleet" / bag.stem / "evaluation.html").is_file()


def test_a_bag_that_cannot_be_read_is_named_in_the_summary_and_by_the_exit_code(tmp_path: Path) -> None:
    bags = tmp_path / "bags"
    bags.mkdir()
    (bags / "broken.mcap").write_bytes(b"no recording")
    tool("simulate", "--bag", tmp_path / "approach.mcap", "--duration-s", "2")
    tool("replay", tmp_path / "approach.mcap", "-o", bags / "whole.mcap")
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(bags), "-o", str(tmp_path / "fleet"), "--workers", "1"]
        + ["--program", str(binary("tanker_pose"))],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    summary = json.loads((tmp_path / "fleet" / "summary.json").read_text(encoding="utf-8"))
    assert [bag["bag"] for bag in summary["bags"]] == ["whole"]
    (failed,) = summary["failed"]
    assert failed["bag"] == "broken" and "neither an MCAP file" in failed["reason"]
