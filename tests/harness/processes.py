"""Starting and ending the programs under test: only what was started here is ever ended here."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from harness.waiting import PATIENCE_S, wait_until

REPOSITORY = Path(__file__).resolve().parents[2]

# The pip wheels of rclpy re-execute Python with these set; a child that inherits them would load
# the wheels' libraries, or skip setting its own paths.
_RCLPY_ONLY = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")


def binary(name: str) -> Path:
    """The built program; TANKER_POSE_BIN_DIR names another directory than the debug build's."""
    directory = Path(os.environ.get("TANKER_POSE_BIN_DIR", REPOSITORY / "target" / "debug"))
    path = (directory / name).resolve()
    assert path.is_file(), f"{path} is not built: run `cargo build --bins` first"
    return path


def plain_python() -> str:
    """The interpreter behind this environment, which knows nothing of ROS."""
    return str(Path(sys.executable).resolve())


def children_of(pid: int) -> set[int]:
    """Ids of the running processes that a process has started."""
    found = set()
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            fields = dict(line.split(":", 1) for line in status.read_text().splitlines())
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields["PPid"]) == pid and not fields["State"].strip().startswith("Z"):
            found.add(int(status.parent.name))
    return found


def example(name: str) -> Path:
    """The built example, beside the programs."""
    path = (binary("tanker_pose").parent / "examples" / name).resolve()
    assert path.is_file(), f"{path} is not built: run `cargo build --examples` first"
    return path


def child_environment(domain: int | None = None) -> dict[str, str]:
    """The environment for a child process, in a ROS domain of its own on this host alone."""
    environment = {key: value for key, value in os.environ.items() if key not in _RCLPY_ONLY}
    environment["RUST_BACKTRACE"] = "1"
    if domain is not None:
        environment["ROS_DOMAIN_ID"] = str(domain)
    return environment


class Process:
    """A running program, its standard error kept in a file."""

    def __init__(
        self,
        command: list[str],
        domain: int,
        directory: Path,
        environment: dict[str, str],
        output: int | None = None,
    ) -> None:
        """Starts it; `output`: where it prints to instead of `log`."""
        directory.mkdir(parents=True, exist_ok=True)
        self.name = Path(command[0]).name
        self._log = directory / f"{self.name}.stderr"
        with self._log.open("wb") as log:
            self._child = subprocess.Popen(
                command,
                # Not the repository: a program must not depend on where it is started.
                cwd=directory,
                env=child_environment(domain) | environment,
                stdin=subprocess.DEVNULL,
                stdout=log if output is None else output,
                stderr=log if output is None else output,
            )

    @property
    def log(self) -> str:
        """All that the program has printed so far."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    @property
    def running(self) -> bool:
        return self._child.poll() is None

    @property
    def pid(self) -> int:
        return self._child.pid

    def send(self, signal_number: int) -> None:
        """Sends a signal without waiting for its effect."""
        self._child.send_signal(signal_number)

    def wait(self, timeout_s: float = PATIENCE_S) -> int:
        """The exit code, once the program has ended by itself or by a signal sent before."""
        wait_until(lambda: not self.running, f"{self.name} to end", timeout_s=timeout_s)
        return self._child.returncode

    def stop(self) -> None:
        """Ends the program as Ctrl-C does and expects it to call that a success."""
        self.send(signal.SIGINT)
        code = self.wait()
        assert code == 0, f"{self.name} ended with {code} after SIGINT:\n{self.log}"

    def kill_if_running(self) -> None:
        """For the end of a failed test: no process outlives it."""
        if self.running:
            self._child.kill()
            self._child.wait()


@contextmanager
def started(*, leave_well: bool = True) -> Iterator[list[Process]]:
    """A list for what a test starts: in the end all of it that still runs must leave with code 0, or is killed."""
    processes: list[Process] = []
    yield processes
    try:
        for process in processes:
            if leave_well and process.running:
                process.stop()
    finally:
        for process in processes:
            process.kill_if_running()
            print(f"--- {process.name} ---\n{process.log}")


def answers(command: list[str | Path], lines: Iterable[str]) -> list[Any]:
    """What a program that answers each line with one of JSON prints."""
    result = subprocess.run(
        command,
        input="".join(f"{line}\n" for line in lines),
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return [json.loads(line) for line in result.stdout.splitlines()]
