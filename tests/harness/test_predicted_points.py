"""Predicted points: a detector that only looks where they say loses the tanker for a second and finds it again."""

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tanker_pose.msg import FeaturePoint, FeaturePointArray

from harness import messages, paper
from harness.conftest import StartEstimator
from harness.estimator import Answer, Estimator
from harness.messages import CAMERA_FRAME, SIGMA_PX, key
from harness.peer import Peer
from harness.rotations import Array
from harness.test_odometry import PERIOD_S, TRACKS, flight

TOPIC = "/predicted_points"
WINDOW_SIGMAS = 4.0
SECOND = round(1.0 / PERIOD_S)


class WindowedDetector:
    """A camera, and a detector that gets each image with its camera info and waits for the prediction of it.

    Once it has seen the tanker it looks for a beacon within four sigmas of where it is predicted, and nowhere else.
    """

    def __init__(
        self,
        estimator: Estimator,
        peer: Peer,
        predicted: list[FeaturePointArray],
        rng: np.random.Generator,
    ) -> None:
        self.estimator = estimator
        self.peer = peer
        self.predicted = predicted
        self.rng = rng
        self._first = estimator.next_index()
        self._next = self._first

    def image(self) -> int:
        """Takes the next image; returns its index."""
        self._next += 1
        return self._next

    def pixels(self, index: int) -> Array:
        return paper.marker_pixels(flight((index - self._first) * PERIOD_S))

    def prediction_for(self, index: int) -> FeaturePointArray:
        """Publishes the image's camera info, and returns what the node predicts for it."""
        info = messages.camera_info()
        info.header = Header(stamp=messages.stamp_of(index), frame_id=CAMERA_FRAME)
        self.estimator.info_publisher.publish(info)
        return self.prediction_at(index)

    def prediction_at(self, index: int) -> FeaturePointArray:
        stamp = key(messages.stamp_of(index))

        def found() -> list[FeaturePointArray]:
            return [m for m in self.predicted if key(m.header.stamp) == stamp]

        self.peer.spin_until(lambda: found() != [], f"a prediction for image {index}")
        assert len(found()) == 1, "each image is predicted once"
        return found()[0]

    def look(self, index: int, prediction: FeaturePointArray | None) -> FeaturePointArray:
        """What it finds: everywhere without a prediction, or only in the windows."""
        found = FeaturePointArray(
            header=Header(stamp=messages.stamp_of(index), frame_id=CAMERA_FRAME)
        )
        noisy = self.pixels(index) + self.rng.normal(0.0, SIGMA_PX, (len(paper.MARKERS), 2))
        windows = {p.id: p for p in prediction.points} if prediction is not None else {}
        for marker, (u, v) in zip(paper.MARKERS, noisy, strict=True):
            window = windows.get(marker)
            is_found = prediction is None or (
                window is not None
                and max(abs(u - window.u), abs(v - window.v)) <= WINDOW_SIGMAS * window.sigma
            )
            if is_found:
                found.points.append(FeaturePoint(id=marker, u=u, v=v, sigma=SIGMA_PX))
        return found

    def see(self, *, everywhere: bool = False) -> Answer:
        index = self.image()
        prediction = self.prediction_for(index)
        return self.estimator.ask(self.look(index, None if everywhere else prediction))

    def miss(self) -> tuple[Answer, FeaturePointArray]:
        """An image in which it sees nothing, and says so."""
        index = self.image()
        prediction = self.prediction_for(index)
        nothing = self.look(index, FeaturePointArray())
        assert not nothing.points
        return self.estimator.ask(nothing), prediction


@pytest.fixture
def detector(
    start_estimator: StartEstimator, peer: Peer, rng: np.random.Generator
) -> WindowedDetector:
    # Before the status is subscribed to: once the node answers, it has found this one, too.
    predicted = peer.collect(FeaturePointArray, TOPIC)
    estimator = start_estimator("-p", "publish_predicted_points:=true")
    estimator.use_camera()
    return WindowedDetector(estimator, peer, predicted, rng)


def test_a_detector_that_only_looks_at_predictions_recovers_after_odometry_has_ended(
    detector: WindowedDetector, peer: Peer
) -> None:
    odometry: list[Odometry] = peer.collect(Odometry, "/odometry")
    first = detector.image()
    assert detector.prediction_for(first).points == [], "nothing is known yet"
    # The only search of whole images.
    for _ in range(3):
        assert detector.see(everywhere=True).outcome == "OK"
    for _ in range(2 * SECOND):
        assert detector.see().outcome == "OK"
    assert TRACKS[detector.see().status.track] == "UPDATED"

    blind = round(1.5 * SECOND)
    sigmas = []
    for _ in range(blind):
        answer, prediction = detector.miss()
        assert answer.outcome == "TOO_FEW_POINTS"
        sigmas.append(max(point.sigma for point in prediction.points))
    assert TRACKS[answer.status.track] == "NONE", "the track has ended"
    last = max(key(message.header.stamp) for message in odometry)
    assert last < key(messages.stamp_of(detector.image() - round(0.4 * SECOND)))
    assert all(a <= b for a, b in zip(sigmas, sigmas[1:], strict=False)), "ever less sure"
    print(f"sigma {sigmas[0]:.1f} px at first, {sigmas[-1]:.1f} px after {blind * PERIOD_S:.1f} s")

    tracks = []
    for _ in range(10):
        answer = detector.see()
        assert answer.outcome == "OK", answer.status.message
        tracks.append(TRACKS[answer.status.track])
    assert tracks[0] == "CANDIDATE" and tracks[-1] == "UPDATED"


def test_predictions_of_an_approach_are_honest(detector: WindowedDetector) -> None:
    for _ in range(10):
        detector.see(everywhere=True)
    squares, inside = [], []
    for _ in range(6 * SECOND):
        index = detector.image()
        prediction = detector.prediction_for(index)
        assert prediction.header == Header(stamp=messages.stamp_of(index), frame_id=CAMERA_FRAME)
        assert [point.id for point in prediction.points] == list(paper.MARKERS)
        seen = detector.look(index, None)
        for point, at in zip(prediction.points, seen.points, strict=True):
            squares.append(((at.u - point.u) ** 2 + (at.v - point.v) ** 2) / point.sigma**2)
            inside.append(max(abs(at.u - point.u), abs(at.v - point.v)) < 4.0 * point.sigma)
        detector.estimator.ask(seen)
    print(f"mean squared distance {np.mean(squares):.2f} of at most 2, in units of sigma²")
    # The sigma is that of the worst direction, so 2 is the most that is honest; the detector's noise is most of it.
    assert 1.0 < np.mean(squares) < 2.2
    assert np.mean(inside) > 0.999


def test_where_camera_info_comes_once_detections_ask_for_the_image_after_them(
    detector: WindowedDetector,
) -> None:
    indices = [detector.image() for _ in range(8)]
    for index in indices[:-1]:
        detector.estimator.ask(detector.look(index, None))
    prediction = detector.prediction_at(indices[-1])
    truth = detector.pixels(indices[-1])
    assert len(prediction.points) == len(truth)
    for point, (u, v) in zip(prediction.points, truth, strict=True):
        assert max(abs(point.u - u), abs(point.v - v)) < 4.0 * point.sigma
        assert point.sigma < 3.0
    # One period after each frame but the first, which has none.
    stamps = [key(message.header.stamp) for message in detector.predicted]
    assert stamps[-len(indices) + 2 :] == [key(messages.stamp_of(i)) for i in indices[2:]]


def test_reset_and_another_camera_end_predictions(detector: WindowedDetector, peer: Peer) -> None:
    for _ in range(8):
        assert detector.see(everywhere=True).outcome == "OK"
    assert len(detector.prediction_for(detector.image()).points) == len(paper.MARKERS)
    peer.call(Trigger, "/tanker_pose/reset", Trigger.Request())
    assert detector.prediction_for(detector.image()).points == []

    for _ in range(8):
        assert detector.see(everywhere=True).outcome == "OK"
    index = detector.image()
    other: CameraInfo = messages.camera_info(frame_id="another_camera")
    other.header.stamp = messages.stamp_of(index)
    detector.estimator.info_publisher.publish(other)
    prediction = detector.prediction_at(index)
    assert (prediction.header.frame_id, prediction.points) == ("another_camera", [])


def test_without_the_parameter_there_is_no_such_topic(estimator: Estimator, peer: Peer) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    assert peer.node.count_publishers(TOPIC) == 0
