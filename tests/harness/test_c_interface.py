"""The C interface: a C program under the sanitizers gives the bits of the Python package, and misuse gives a status."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from harness.processes import REPOSITORY, binary, child_environment
from harness.python_package import IDS, POINTS, camera, frames, tpe

FRAMES = 10_000
SANITIZERS = "-fsanitize=address,undefined"
FLAGS = ("-std=c11", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Werror", SANITIZERS, "-fno-sanitize-recover=all")


def compiled(source: Path, program: Path) -> Path:
    """A C program with the static library."""
    compiler = shutil.which(os.environ.get("CC", "gcc"))
    assert compiler, "a C compiler is needed"
    library = binary("libtanker_pose_c.a")
    include = REPOSITORY / "crates" / "tanker_pose_c" / "include"
    command = [compiler, *FLAGS, f"-I{include}", str(source), str(library), "-lm", "-lpthread", "-ldl"]
    done = subprocess.run([*command, "-o", str(program)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return program


def run(program: Path, text: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(program)], input=text, env=child_environment(), capture_output=True, text=True, timeout=120, check=False
    )


def test_a_c_program_under_the_sanitizers_gives_the_same_bits(tmp_path: Path, rng: np.random.Generator) -> None:
    program = compiled(REPOSITORY / "examples" / "c" / "solve_frames.c", tmp_path / "solve_frames")
    pixels, sigmas = frames(FRAMES, rng)
    pixels[1, 2, 0] = np.nan
    sigmas[2, 3] = -1.0
    lines = [
        " ".join([str(len(IDS)), *(f"{i} {u!r} {v!r} {s!r}" for i, (u, v), s in zip(IDS, *frame, strict=True))])
        for frame in zip(pixels.tolist(), sigmas.tolist(), strict=True)
    ]

    done = run(program, "\n".join(lines) + "\n")

    assert (done.returncode, done.stderr) == (0, "")
    printed = [line.split() for line in done.stdout.splitlines()]
    records = tpe.Estimator(camera(), POINTS, ids=IDS).estimate_many(pixels, sigmas)
    assert [words[0] for words in printed] == [tpe.Outcome(code).name for code in records["outcome"]]
    assert {"OK", "NOT_FINITE", "INVALID_SIGMA"} <= {words[0] for words in printed}
    for words, record in zip(printed, records, strict=True):
        numbers = np.array([float(word) for word in words[1:]])
        if words[0] == "OK":
            expected = [record["rotation"].ravel(), record["translation"], record["covariance"].ravel()]
            assert numbers.tobytes() == np.concatenate(expected).tobytes()
        else:
            assert len(numbers) == 0


def test_misuse_gives_a_status_and_words(tmp_path: Path) -> None:
    program = compiled(Path(__file__).parent / "fixtures" / "c" / "misuse.c", tmp_path / "misuse")
    done = run(program)
    assert (done.returncode, done.stderr) == (0, "")
    assert "k[0]" in done.stdout and "pixel_sigma_px" in done.stdout and "marker" in done.stdout
