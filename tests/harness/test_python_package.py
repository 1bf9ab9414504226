"""The Python package: the bits of the program, arrays checked as messages are, the program's words in exceptions."""

import ast
import inspect
import json
import multiprocessing
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from harness import paper
from harness.bags import read_bag, write_approach_bag
from harness.processes import REPOSITORY, binary, child_environment
from harness.python_package import IDS, POINTS, camera, directory, frames, tpe
from harness.solver import request, solve

FRAMES = 300
MAP = tpe.MarkerMap.shipped("paper")
NUMBERS = ("rms_px", "chi_squared", "chi_squared_limit", "ambiguity", "degrees_of_freedom", "iterations")
FLIGHT = REPOSITORY / "examples" / "notebooks" / "approach.mcap"
PACKAGE = directory() / "tanker_pose_estimator"


def estimator(**parameters: Any) -> tpe.Estimator:
    return tpe.Estimator(camera(), POINTS, ids=IDS, **parameters)


def estimated(estimate_many: Any, *arrays: Any) -> bytes:
    return estimate_many(*arrays).tobytes()


def bits(values: Any) -> bytes:
    return np.asarray(values, dtype=np.float64).tobytes()


def test_many_frames_have_the_bits_of_the_program(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(FRAMES, rng)
    lines = [json.dumps(request(n, *frame)) for n, frame in enumerate(zip(pixels, sigmas, strict=True))]

    records = estimator().estimate_many(pixels, sigmas)

    printed = solve(*lines)
    outcomes = [tpe.Outcome(record["outcome"]).name.lower() for record in records]
    assert outcomes == [answer["outcome"] for answer in printed]
    assert outcomes.count("ok") > FRAMES // 2
    for record, answer in zip(records, printed, strict=True):
        used = [id_ for id_, is_used in zip(IDS, record["used"], strict=True) if is_used]
        assert used == sorted(answer["used_ids"])
        for name in ("rms_px", "chi_squared", "ambiguity"):
            assert bits(record[name]) == bits(answer.get(name, np.nan))
        assert record["iterations"] == answer.get("iterations", 0)
        if answer["outcome"] == "ok":
            for name in ("rotation", "translation", "covariance"):
                assert bits(record[name]) == bits(answer[name]), name
        else:
            assert np.isnan(record["rotation"]).all() and np.isnan(record["covariance"]).all()


def test_options_and_budgets_reach_the_estimate_as_they_do_in_the_program(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    pixels, _ = frames(40, rng)
    budget = {"sigmas": {"fx": 1.5, "fy": 1.5, "k1": 0.01}}
    (tmp_path / "budget.yaml").write_text(json.dumps(budget), encoding="utf-8")
    lines = [json.dumps(request(n, frame, 0.0)) for n, frame in enumerate(pixels)]
    options = ("--initialisation", "global", "--certify", "--jitter-px", "0.3", "--pixel-sigma-px", "0.7")
    file = ("--calibration-budget-file", str(tmp_path / "budget.yaml"))
    parameters = {"initialisation": "global", "certify": True, "jitter_px": 0.3, "pixel_sigma_px": 0.7}

    for given in (tpe.Budget.from_dict(budget), tpe.Budget.from_file(tmp_path / "budget.yaml")):
        records = estimator(budget=given, **parameters).estimate_many(pixels)
        printed = solve(*lines, arguments=(*options, *file))
        for record, answer in zip(records, printed, strict=True):
            assert tpe.Outcome(record["outcome"]).name.lower() == answer["outcome"]
            if answer["outcome"] == "ok":
                assert bits(record["covariance"]) == bits(answer["covariance"])
                assert record["certificate"] == 1


def test_many_are_one_by_one(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(FRAMES, rng)
    visible = rng.uniform(size=sigmas.shape) < 0.9
    one = estimator()

    records = one.estimate_many(pixels, sigmas, visible=visible)

    for record, seen, sigma, mask in zip(records, pixels, sigmas, visible, strict=True):
        try:
            frame = one.estimate(seen[mask], sigma[mask], ids=np.array(IDS)[mask])
        except tpe.RefusalError as refusal:
            frame = refusal.frame
            assert str(refusal) == frame.message != ""
            with pytest.raises(tpe.RefusalError, match="expected"):
                _ = frame.rotation
        else:
            for name in ("rotation", "translation", "covariance"):
                assert bits(record[name]) == bits(getattr(frame, name))
        assert record["outcome"] == frame.outcome
        assert frame.used_ids == [id_ for id_, used in zip(IDS, record["used"], strict=True) if used]
        for name in NUMBERS:
            number = getattr(frame, name)
            expected = (0 if record[name].dtype.kind == "u" else np.nan) if number is None else number
            assert bits(record[name]) == bits(expected), name
    assert len({tpe.Outcome(code) for code in records["outcome"]}) > 1


def test_order_layout_and_type_of_arrays_do_not_matter(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(20, rng)
    pixels = pixels.astype(np.float32).astype(np.float64)
    expected = estimator().estimate_many(pixels, sigmas).tobytes()

    assert estimator().estimate_many(pixels.astype(np.float32), sigmas).tobytes() == expected
    assert estimator().estimate_many(np.asfortranarray(pixels), sigmas).tobytes() == expected
    assert estimator().estimate_many(pixels.tolist(), sigmas.tolist()).tobytes() == expected
    assert estimator().estimate_many(pixels[::-1], sigmas[::-1])[::-1].tobytes() == expected
    apart = np.zeros(pixels.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(pixels.shape)
    apart[:] = pixels
    assert not apart.flags.aligned and estimator().estimate_many(apart, sigmas).tobytes() == expected
    of_map = tpe.Estimator(camera(), MAP).estimate_many(pixels, sigmas)
    assert of_map.tobytes() == expected


def test_no_frames_are_no_records() -> None:
    records = estimator().estimate_many(np.empty((0, 6, 2)))
    assert records.shape == (0,) and records["rotation"].shape == (0, 3, 3)


def test_what_cannot_be_used_raises_with_words(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(3, rng)
    one = estimator()
    for call, words in [
        (lambda: one.estimate_many(pixels[0]), r"expected an array of shape \(frames, 6, 2\), got shape \[6, 2\]"),
        (lambda: one.estimate_many(pixels[:, :5]), r"got shape \[3, 5, 2\]"),
        (lambda: one.estimate(pixels), r"expected an array of shape \(6, 2\)"),
        (lambda: one.estimate_many(pixels, sigmas[:2]), r"sigma_px: .* or \(3, 6\), got shape \[2, 6\]"),
        (lambda: one.estimate_many(pixels, visible=np.ones((3, 6))), "expected an array of bool, got float64"),
        (lambda: one.estimate_many(pixels, visible=np.ones((6, 3), bool)), r"visible: .*\(3, 6\)"),
        (lambda: one.estimate(pixels[0], ids=[1, 2, 3, 4, 5, -6]), "ids: expected a sequence of whole numbers"),
        (lambda: one.estimate(pixels[0].astype(str)[:, :1]), "shape"),
        (lambda: one.estimate_many(np.ma.masked_invalid(pixels)), "without a mask"),
        (lambda: tpe.estimate(camera(), POINTS, pixels[0], ids=[1.5, 2, 3, 4, 5, 6]), "ids: expected"),
        (lambda: tpe.Estimator(camera(), POINTS, ids=[1, 1, 2, 3, 4, 5]), "id 1 .*2"),
        (lambda: tpe.Estimator(camera(), MAP, ids=[1, 2, 77]), "77"),
        (lambda: tpe.Estimator(camera(), POINTS * np.nan), "expected coordinates within .* NaN"),
        (lambda: tpe.Estimator(camera(), POINTS[:, :2]), r"shape \(N, 3\), got shape \[6, 2\]"),
        (lambda: estimator(pixel_sigma_px=-1.0), r'parameter "pixel_sigma_px" must be from'),
        (lambda: estimator(pixel_sigma=1.0), r'unknown parameter "pixel_sigma".*pixel_sigma_px'),
        (lambda: estimator(max_gap_s=1.0), r'parameter "max_gap_s" has no effect here; Pipeline takes it'),
        (lambda: estimator(publish_tf=True), r'parameter "publish_tf" has no effect here'),
        (lambda: estimator(initialisation="best"), "must be one of nominal, dlt, previous, global"),
        (lambda: estimator(initialisation="previous").estimate_many(pixels), "use Pipeline"),
        (lambda: estimator(budget=tpe.Budget.from_dict({"sigmas": {"fx": 1.0}}), k1_sigma=0.1), "set only one"),
        (lambda: tpe.Budget.from_dict({"sigmas": {"k9": 1.0}}), "k9"),
        (lambda: tpe.Camera(0.0, 571.0, 254.0, 206.0), "not calibrated"),
        (lambda: tpe.Camera(np.nan, 571.0, 254.0, 206.0), "NaN"),
        (lambda: tpe.Camera.from_dict({"k": [1.0] * 8}), "expected 9 numbers in k, got 8"),
        (lambda: tpe.Camera.from_dict({"width": 5}), 'missing field "k"'),
        (lambda: camera(fx=571.0), 'unknown field "fx"'),
        (lambda: tpe.MarkerMap.shipped("747"), "expected one of paper, fin6"),
        (lambda: tpe.MarkerMap.from_dict({"name": "stick", "markers": []}), "marker"),
        (lambda: one.estimate(pixels[0], previous=np.ones((3, 3))), "expected a rotation"),
    ]:
        with pytest.raises(ValueError, match=words):
            call()


def test_a_detection_that_is_wrong_is_refused_with_the_programs_words(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(1, rng)
    cases = []
    for place, value in [((2, 0), np.nan), ((1, 1), np.inf), ((0, 0), 1e4)]:
        wrong = pixels[0].copy()
        wrong[place] = value
        cases.append((wrong, sigmas[0], IDS))
    cases.append((pixels[0], np.where(np.arange(6) == 3, -1.0, 0.5), IDS))
    cases.append((pixels[0], sigmas[0], [1, 2, 3, 4, 5, 9]))
    cases.append((pixels[0], sigmas[0], [1, 2, 3, 4, 5, 5]))
    cases.append((pixels[0][:3], sigmas[0][:3], IDS[:3]))

    for wrong, sigma, ids in cases:
        with pytest.raises(tpe.RefusalError) as refusal:
            estimator().estimate(wrong, sigma, ids=ids)
        if np.isfinite(wrong).all() and 9 not in ids:
            line = request(0, pixels[0])
            line["points"] = [
                point | {"id": id_, "u": u, "v": v, "sigma": s}
                for point, id_, (u, v), s in zip(line["points"], ids, wrong.tolist(), sigma, strict=False)
            ]
            (answer,) = solve(json.dumps(line))
            assert str(refusal.value) == answer["message"]
            assert tpe.Outcome(refusal.value.frame.outcome).name.lower() == answer["outcome"]
        else:
            assert "expected" in str(refusal.value) or "id" in str(refusal.value)
            assert refusal.value.frame.outcome in (tpe.Outcome.NOT_FINITE, tpe.Outcome.UNKNOWN_ID)


def test_other_threads_run_while_many_frames_are_estimated(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(200, rng)
    pixels, sigmas = np.tile(pixels, (500, 1, 1)), np.tile(sigmas, (500, 1))
    one = estimator()
    order = []

    def work() -> None:
        order.append("begun")
        one.estimate_many(pixels, sigmas)
        order.append("done")

    interval_s = sys.getswitchinterval()
    # A thread then keeps the GIL until it gives it away.
    sys.setswitchinterval(1000.0)
    try:
        thread = threading.Thread(target=work)
        thread.start()
        order.append("meanwhile")
        thread.join()
    finally:
        sys.setswitchinterval(interval_s)
    assert order == ["begun", "meanwhile", "done"]


def test_a_forked_process_estimates_many_frames_too(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(1000, rng)
    one = estimator()
    expected = one.estimate_many(pixels, sigmas).tobytes()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        found = pool.apply_async(estimated, (one.estimate_many, pixels, sigmas)).get(timeout=30)
    assert found == expected


def test_estimate_keeps_estimators_by_what_they_are_made_of(rng: np.random.Generator) -> None:
    pixels, _ = frames(2, rng)
    seen, points = camera(), POINTS.copy()
    first = tpe.estimate(seen, points, pixels[1], ids=IDS)
    assert bits(tpe.estimate(seen, points, pixels[1], ids=IDS).translation) == bits(first.translation)
    points += [1.0, 0.0, 0.0]
    moved = tpe.estimate(seen, points, pixels[1], ids=IDS)
    assert np.allclose(moved.translation, first.translation - first.rotation[:, 0], atol=1e-6)
    with pytest.raises(ValueError, match="certify"):
        tpe.estimate(seen, points, pixels[1], certify=1)
    assert tpe.estimate(seen, points, pixels[1], certify=True).certificate == "certified"
    with pytest.raises(ValueError, match="certify"):
        tpe.estimate(seen, points, pixels[1], certify=1)
    for sigma_px in np.linspace(0.3, 0.6, 40):
        assert tpe.estimate(seen, MAP, pixels[1], pixel_sigma_px=sigma_px).is_trusted
    assert len(tpe._kept) <= tpe._MOST_KEPT


def test_a_pipeline_answers_a_bag_as_replay_does(tmp_path: Path, rng: np.random.Generator) -> None:
    write_approach_bag(tmp_path / "approach", StoragePlugin.MCAP, 60, rng)
    bag = read_bag(tmp_path / "approach")
    pipeline = tpe.Pipeline(camera(), MAP, edge_margin_px=0.0)

    replayed = tpe.replay(tmp_path / "approach", parameters={"edge_margin_px": 0.0})

    status, pose, odometry = (replayed.topics[name] for name in ("/status", "/pose", "/odometry"))
    assert (replayed.frames, replayed.outcomes, replayed.skipped) == (60, {"OK": 60}, [])
    tracked = []
    for row, message in enumerate(bag["/feature_points"]):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        seen = message.points
        frame = pipeline.process(
            stamp,
            [[point.u, point.v] for point in seen],
            [point.sigma for point in seen],
            ids=[point.id for point in seen],
        )
        assert status["stamp_ns"][row] == pose["stamp_ns"][row] == stamp
        assert (status["outcome"][row], status["track"][row]) == (frame.outcome, frame.track)
        assert bits(status["chi_squared"][row]) == bits(frame.chi_squared)
        assert status["used_ids"][row] == frame.used_ids
        assert bits(pose["translation"][row]) == bits(frame.translation)
        assert bits(pose["covariance"][row]) == bits(frame.covariance)
        if frame.motion is not None:
            tracked.append((stamp, frame.motion))
    assert [stamp for stamp, _ in tracked] == odometry["stamp_ns"].tolist()
    assert len(tracked) > 40
    for row, (_, motion) in enumerate(tracked):
        assert bits(odometry["translation"][row]) == bits(motion.translation)
        assert bits(odometry["covariance"][row]) == bits(motion.covariance[:6, :6])
        assert np.allclose(motion.rotation @ odometry["linear"][row], motion.velocity, atol=1e-12)


def test_a_pipeline_gives_every_frame_an_outcome_and_forgets_on_reset(rng: np.random.Generator) -> None:
    pixels, sigmas = frames(10, rng)
    pipeline = tpe.Pipeline(camera(), MAP, confirm_frames=3)
    assert pipeline.process(0, pixels[1], sigmas[1]).outcome == tpe.Outcome.ZERO_STAMP
    assert pipeline.process(1, pixels[1], sigmas[1], frame_id="left").outcome == tpe.Outcome.FRAME_MISMATCH
    steps = [pipeline.process(10**9 + 10**7 * n, pixels[1], sigmas[1]).track for n in range(4)]
    assert steps[-1] == tpe.Track.UPDATED
    assert pipeline.process(2 * 10**9, pixels[1][:2], ids=[1, 2]).track == tpe.Track.PREDICTED
    pipeline.reset()
    assert pipeline.process(2 * 10**9 + 10**8, pixels[1], sigmas[1]).track == tpe.Track.CANDIDATE
    assert pipeline.set_camera(camera()) is False
    assert pipeline.set_camera(camera(width=510)) is True
    with pytest.raises(ValueError, match="stamp_ns"):
        pipeline.process(2**62, pixels[1])


def test_a_recording_that_cannot_be_read_raises_with_words(tmp_path: Path) -> None:
    (tmp_path / "no.mcap").write_bytes(b"nothing of the kind")
    with pytest.raises(ValueError, match="no.mcap"):
        tpe.replay(tmp_path / "no.mcap")
    with pytest.raises(ValueError, match='unknown parameter "edge"'):
        tpe.replay(tmp_path / "no.mcap", parameters={"edge": 1.0})


def test_the_command_of_the_wheel_is_the_program(tmp_path: Path, rng: np.random.Generator) -> None:
    environment = child_environment() | {"PYTHONPATH": str(directory())}
    programs = {"wheel": [sys.executable, str(directory() / "bin" / "tanker_pose")], "cargo": [binary("tanker_pose")]}

    def both(*arguments: str, text: str = "") -> subprocess.CompletedProcess[str]:
        """Runs both in a folder of their own; returns what they agree on."""
        done = {}
        for name, program in programs.items():
            (tmp_path / name).mkdir(exist_ok=True)
            done[name] = subprocess.run(
                [*program, *arguments],
                input=text,
                env=environment,
                cwd=tmp_path / name,
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
        wheel, cargo = done.values()
        assert (wheel.returncode, wheel.stdout, wheel.stderr) == (cargo.returncode, cargo.stdout, cargo.stderr)
        return wheel

    assert both("solve", text=json.dumps(request(5, frames(1, rng)[0][0]))).stdout.startswith('{"id":5')
    assert both("check", "--marker-map", "paper").returncode == 1
    assert both("replay", str(FLIGHT), "-o", "answers.mcap").returncode == 0
    assert both("evaluate", "answers.mcap", "-o", "report").returncode == 0
    for file in ("answers.mcap", "report/evaluation.json"):
        wheel, cargo = ((tmp_path / name / file).read_bytes() for name in programs)
        assert wheel == cargo, file
    assert "nowhere.mcap" in both("replay", "/nowhere.mcap").stderr
    assert both("solved").returncode == both("solve", "--no-such-option").returncode == 2

    help_ = subprocess.run(
        [*programs["wheel"], "--help"], env=environment, capture_output=True, text=True, timeout=60, check=True
    )
    words = set(help_.stdout.split())
    assert {"solve", "replay", "evaluate", "check", "reproduce"} <= words and not words & {"simulate", "demo", "watch"}


def test_the_programs_of_the_page_run(
    tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (REPOSITORY / "docs" / "python.md").read_text(encoding="utf-8")
    programs = [part.split("```")[0] for part in page.split("```python\n")[1:]]
    pixels, sigma_px = frames(50, rng)
    shutil.copy(REPOSITORY / "config" / "tankers" / "paper.yaml", tmp_path / "tanker.yaml")
    shutil.copy(FLIGHT, tmp_path / "flight.mcap")
    monkeypatch.chdir(tmp_path)
    seen = [0, 1, 3, 4, 5]
    flight = {"stamp_ns": 10**9, "pixels": pixels[1][seen], "sigma_px": sigma_px[1][seen]}
    given: list[dict[str, Any]] = [
        {},
        {"pixels": pixels, "sigma_px": sigma_px, "visible": rng.uniform(size=sigma_px.shape) < 0.95},
        flight,
        {},
    ]

    names: dict[str, Any] = {}
    printed = []
    for program, inputs in zip(programs, given, strict=True):
        names |= inputs
        exec(compile(program, "docs/python.md", "exec"), names)
        printed.append(capsys.readouterr().out)

    numbers = [float(word) for word in printed[0].replace("[", " ").replace("]", " ").split()]
    assert np.allclose(numbers[:3], paper.POSE.translation, atol=0.3)
    assert len(numbers) == 9 and all(number > 0.0 for number in numbers[3:])
    assert len(names["records"]) == 50 and 0 < len(names["good"]) < 50
    assert names["frame"].is_trusted
    assert names["status"]["outcome"].shape == (names["replayed"].frames,) == (200,)
    poses = names["poses"]
    assert {"stamp_ns", "translation_2", "quaternion_xyzw_3", "covariance_5_5"} <= set(poses.columns)
    covariances = names["replayed"].topics["/pose"]["covariance"]
    assert poses["covariance_0_2"].tolist() == covariances[:, 0, 2].tolist()
    assert names["replayed"].dataframe("/status")["used_ids"][1] == IDS


def test_enums_are_those_of_the_status_message() -> None:
    outcomes, tracks = tpe._native.codes()
    assert [(code.name, code.value) for code in tpe.Outcome] == outcomes
    assert [(code.name, code.value) for code in tpe.Track] == tracks


def signature(function: ast.FunctionDef) -> list[tuple[str, str, bool]]:
    """Name, kind and whether there is a default of each argument in a stub."""
    given = function.args
    positional = [*given.posonlyargs, *given.args]
    defaults = [None] * (len(positional) - len(given.defaults)) + list(given.defaults)
    found = [(a.arg, "POSITIONAL_OR_KEYWORD", d is not None) for a, d in zip(positional, defaults, strict=True)]
    found += [(a.arg, "KEYWORD_ONLY", d is not None) for a, d in zip(given.kwonlyargs, given.kw_defaults, strict=True)]
    if given.kwarg:
        found.append((given.kwarg.arg, "VAR_KEYWORD", False))
    return [argument for argument in found if argument[0] not in ("self", "cls")]


def actual(function: Any) -> list[tuple[str, str, bool]]:
    empty = inspect.Parameter.empty
    found = inspect.signature(function).parameters.values()
    return [(p.name, p.kind.name, p.default is not empty) for p in found if p.name not in ("self", "cls")]


def test_the_stub_names_what_there_is_with_its_arguments() -> None:
    tree = ast.parse((PACKAGE / "_native.pyi").read_text(encoding="utf-8"))
    native = tpe._native
    named = {node.name for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert named == {name for name in vars(native) if not name.startswith("_")}
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            assert signature(node) == actual(getattr(native, node.name)), node.name
        if not isinstance(node, ast.ClassDef) or node.name == "RefusalError":
            continue
        kind = getattr(native, node.name)
        methods = {method.name: method for method in node.body if isinstance(method, ast.FunctionDef)}
        public = {name for name in vars(kind) if not name.startswith("_")}
        assert public == {name for name in methods if not name.startswith("_")}, node.name
        for name, method in methods.items():
            decorators = [ast.unparse(decorator) for decorator in method.decorator_list]
            if "property" in decorators:
                assert inspect.isdatadescriptor(getattr(kind, name)), (node.name, name)
                assert getattr(kind, name).__doc__
            elif name == "__new__":
                assert signature(method) == actual(kind), node.name
            elif name != "__len__":
                assert signature(method) == actual(getattr(kind, name)), (node.name, name)
                assert getattr(kind, name).__doc__, (node.name, name)
    assert (PACKAGE / "py.typed").is_file()


def test_the_wheel_serves_every_python_since_3_10_and_names_every_crate_in_it() -> None:
    (info,) = directory().glob("tanker_pose_estimator-*.dist-info")
    tags = [line for line in (info / "WHEEL").read_text().splitlines() if line.startswith("Tag:")]
    assert all("cp310-abi3" in tag for tag in tags) and tags
    (bill,) = (info / "sboms").glob("*.json")
    components = {(part["name"], part["version"]) for part in json.loads(bill.read_text(encoding="utf-8"))["components"]}
    tree = ["cargo", "tree", "--locked", "--offline", "-p", "tanker_pose_py", "-e", "normal", "--prefix", "none"]
    done = subprocess.run(tree, cwd=REPOSITORY, capture_output=True, text=True, timeout=60, check=True)
    crates = {tuple(line.split()[:2]) for line in done.stdout.splitlines()}
    crates = {(name, version.removeprefix("v")) for name, version in crates if name != "tanker_pose_py"}
    assert len(crates) > 100 and crates <= components
