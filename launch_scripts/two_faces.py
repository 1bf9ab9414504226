"""One description of a launch, two ways to start it: `ros2 launch`, or Python alone where ROS is not installed.

A launch file names its arguments, and makes from their values the programs to start. `ros2 launch` gets a
LaunchDescription of them; run as a script it takes the same `name:=value` arguments and starts the same programs.
In both, Ctrl-C or the end of one program ends them all.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

# The repository, or share/tanker_pose where the package is installed: config/ is in both.
SHARE = Path(__file__).resolve().parent.parent
# How long programs may take to end after SIGINT, and then after SIGTERM.
GRACE_S = (10.0, 3.0)
POLL_S = 0.05

BOOLEAN = ("true", "false")


@dataclass(frozen=True)
class Argument:
    """What a launch file can be told, as `name:=value`."""

    name: str
    default: str
    meaning: str
    choices: Sequence[str] = ()


@dataclass(frozen=True)
class Program:
    """A program of a ROS package, with what its command line says."""

    executable: str
    package: str = "tanker_pose"
    words: Sequence[str] = ()
    takes_ros_arguments: bool = True
    name: str = ""
    namespace: str = ""
    parameter_files: Sequence[str] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    remaps: Mapping[str, str] = field(default_factory=dict)
    # Said instead of starting it where the package is not installed; without it that is an error.
    instead: str = ""

    def parameter_words(self) -> list[str]:
        files = [word for path in self.parameter_files for word in ("--params-file", path)]
        values = [word for pair in self.parameters.items() for word in ("-p", ":=".join(pair))]
        return files + values

    def command(self, path: Path) -> list[str]:
        """The whole command line, as `ros2 launch` would make it."""
        own = [str(path), *self.words]
        if not self.takes_ros_arguments:
            return own
        remaps = dict(self.remaps)
        if self.name:
            remaps["__node"] = self.name
        if self.namespace:
            remaps["__ns"] = "/" + self.namespace.strip("/")
        renames = [word for pair in remaps.items() for word in ("-r", ":=".join(pair))]
        return [*own, "--ros-args", *self.parameter_words(), *renames]


class LaunchError(Exception):
    """What is wrong with the arguments or the installation, in words for people."""


def text(value: str) -> str:
    """A parameter's value that stays text even if it looks like a number."""
    return "'" + value.replace("'", "''") + "'"


def given(**values: str) -> dict[str, str]:
    """The parameters that have a value."""
    return {name: value for name, value in values.items() if value}


@dataclass(frozen=True)
class Launch:
    """Arguments, and the programs that their values ask for."""

    about: str
    arguments: Sequence[Argument]
    programs: Callable[[Mapping[str, str]], Iterable[Program]]

    def description(self) -> Any:
        """For `ros2 launch`: the only place that imports it."""
        from launch import LaunchDescription
        from launch.actions import DeclareLaunchArgument, OpaqueFunction
        from launch.substitutions import LaunchConfiguration

        def declared(argument: Argument) -> Any:
            choices = {"choices": list(argument.choices)} if argument.choices else {}
            return DeclareLaunchArgument(
                argument.name,
                default_value=argument.default,
                description=argument.meaning,
                **choices,
            )

        def start(context: Any) -> list[Any]:
            values = {
                argument.name: LaunchConfiguration(argument.name).perform(context)
                for argument in self.arguments
            }
            return [_action(program) for program in self.programs(values)]

        return LaunchDescription(
            [*(declared(argument) for argument in self.arguments), OpaqueFunction(function=start)]
        )

    def main(self, words: Sequence[str] | None = None) -> int:
        """For Python alone: runs until Ctrl-C or until a program ends; returns the exit code."""
        words = sys.argv[1:] if words is None else words
        if any(word in ("-h", "--help", "-s", "--show-args") for word in words):
            print(self.help())
            return 0
        try:
            values = self.values(words)
            commands = [command for program in self.programs(values) if (command := _find(program))]
        except LaunchError as error:
            print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
            return 2
        return _run(commands)

    def values(self, words: Sequence[str]) -> dict[str, str]:
        """A value for every argument."""
        known = {argument.name: argument for argument in self.arguments}
        values = {argument.name: argument.default for argument in self.arguments}
        for word in words:
            name, assigned, value = word.partition(":=")
            if not assigned:
                raise LaunchError(f"expected name:=value, got {word!r}")
            if name not in known:
                raise LaunchError(f"there is no argument {name!r}: they are {', '.join(known)}")
            choices = known[name].choices
            if choices and value not in choices:
                raise LaunchError(f"{name} must be {' or '.join(choices)}, got {value!r}")
            values[name] = value
        return values

    def help(self) -> str:
        """What `--help` prints."""
        lines = [self.about.strip(), "", "Arguments, as name:=value:"]
        for argument in self.arguments:
            lines.append(f"  {argument.name} ({argument.default!r}): {argument.meaning}")
        return "\n".join(lines)


def _action(program: Program) -> Any:
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix
    from launch.actions import ExecuteProcess, LogInfo, Shutdown
    from launch_ros.actions import Node
    from launch_ros.substitutions import ExecutableInPackage

    if program.instead:
        try:
            get_package_prefix(program.package)
        except PackageNotFoundError:
            return LogInfo(msg=program.instead)
    end = Shutdown(reason=f"{program.executable} has ended")
    if not program.takes_ros_arguments:
        found = ExecutableInPackage(executable=program.executable, package=program.package)
        return ExecuteProcess(cmd=[found, *program.words], output="screen", on_exit=end)
    return Node(
        package=program.package,
        executable=program.executable,
        name=program.name or None,
        namespace=program.namespace or None,
        arguments=list(program.words),
        ros_arguments=program.parameter_words(),
        remappings=list(program.remaps.items()),
        output="screen",
        on_exit=end,
    )


def _find(program: Program) -> list[str] | None:
    """The command line of a program; none, with a word about it, where it may be missing and is."""
    places = [
        Path(prefix) / "lib" / program.package
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        if prefix
    ]
    if program.package == "tanker_pose":
        chosen = os.environ.get("TANKER_POSE_BIN_DIR")
        built = [SHARE / "target" / "release", SHARE / "target" / "debug"]
        places = [Path(chosen)] if chosen else [SHARE.parent.parent / "lib/tanker_pose", *built, *places]
    paths = [str(place / program.executable) for place in places] + [program.executable]
    for path in paths:
        if found := shutil.which(path):
            return program.command(Path(found))
    if program.instead:
        print(program.instead, flush=True)
        return None
    hint = "build it with `cargo build --release`" if program.package == "tanker_pose" else "install it"
    raise LaunchError(f"{program.executable} of package {program.package} was not found: {hint}")


def _run(commands: Sequence[Sequence[str]]) -> int:
    stop: list[int] = []
    # Before anything is started: a signal in between must not leave a program behind.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda received, _: stop.append(received))
    children: list[subprocess.Popen[bytes]] = []
    try:
        for command in commands:
            # In sessions of their own, so that Ctrl-C reaches each once, from here.
            children.append(subprocess.Popen(command, start_new_session=True))
        while children and not stop and all(child.poll() is None for child in children):
            time.sleep(POLL_S)
    finally:
        ended = [child for child in children if child.poll() is not None]
        _end(children)
    if stop or not ended:
        return max((abs(child.returncode) for child in children), default=0)
    # What ended first says whether all went well.
    return abs(ended[0].returncode)


def _end(children: Sequence[subprocess.Popen[bytes]]) -> None:
    for number, grace_s in zip((signal.SIGINT, signal.SIGTERM), GRACE_S, strict=True):
        running = [child for child in children if child.poll() is None]
        for child in running:
            child.send_signal(number)
        deadline = time.monotonic() + grace_s
        while any(child.poll() is None for child in running) and time.monotonic() < deadline:
            time.sleep(POLL_S)
    for child in children:
        if child.poll() is None:
            child.kill()
        child.wait()
