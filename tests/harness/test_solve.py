"""`tanker_pose solve` through a pipe: a JSON line in, a JSON line out, whatever the line holds."""

import json

import numpy as np

from harness import paper
from harness.consistency import cramer_rao_covariance, nees, pose_error
from harness.solver import pose_in, request, solve

EXACT = 3e-4


def test_an_exact_frame_is_solved_exactly() -> None:
    (answer,) = solve(json.dumps(request(7, paper.marker_pixels(paper.POSE))))

    assert answer["id"] == 7
    assert answer["outcome"] == "ok"
    assert answer["message"] == ""
    assert np.abs(pose_error(paper.POSE, pose_in(answer))).max() < EXACT
    assert sorted(answer["used_ids"]) == [1, 2, 3, 4, 5, 6]
    assert answer["rejected_ids"] == []
    assert answer["rms_px"] < 1e-2
    assert answer["iterations"] >= 1
    expected = cramer_rao_covariance(paper.POSE, paper.MARKERS, paper.CAMERA, np.full(6, 0.5))
    assert np.allclose(
        np.diag(np.array(answer["covariance"]).reshape(6, 6)), np.diag(expected), rtol=0.01
    )


def test_noisy_frames_come_back_in_order_and_near_the_truth(rng: np.random.Generator) -> None:
    truths = [paper.seeded_pose(rng) for _ in range(20)]
    lines = []
    for number, truth in enumerate(truths):
        pixels = paper.marker_pixels(truth)
        lines.append(json.dumps(request(number, pixels + rng.normal(0.0, 0.5, pixels.shape))))

    answers = solve(*lines)

    assert [answer["id"] for answer in answers] == list(range(20))
    for truth, answer in zip(truths, answers, strict=True):
        assert answer["outcome"] == "ok", answer["message"]
        covariance = np.array(answer["covariance"]).reshape(6, 6)
        # 27.9: an honest frame in ten thousand exceeds it.
        assert nees(truth, pose_in(answer), covariance) < 27.9


def test_a_bad_line_is_answered_and_the_next_one_solved() -> None:
    good = json.dumps(request(2, paper.marker_pixels(paper.POSE)))
    few = request(1, paper.marker_pixels(paper.POSE))
    few["points"] = few["points"][:2]

    answers = solve("{not json", good, json.dumps(few), '{"id": 4}', good)

    assert [answer["outcome"] == "ok" for answer in answers] == [False, True, False, False, True]
    assert answers[2]["outcome"] == "too_few_points"
    assert answers[2]["id"] == 1
    for answer in (answers[0], answers[2], answers[3]):
        assert answer["message"].strip()
        assert not answer.get("translation")


def test_no_input_gives_no_output() -> None:
    assert solve() == []
