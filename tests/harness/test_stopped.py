"""A process that was stopped and continued: the middleware does not outlive that, and the node says so and ends."""

import signal
import time

from harness import messages
from harness.conftest import StartEstimator

# Long enough that the middleware's threads are waiting when it begins.
PAUSE_S = 1.0


def test_the_node_ends_with_the_reason_when_the_middleware_has_ended(
    start_estimator: StartEstimator,
) -> None:
    estimator = start_estimator()
    estimator.use_camera()
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    process = estimator.process

    process.send(signal.SIGSTOP)
    time.sleep(PAUSE_S)
    process.send(signal.SIGCONT)

    assert process.wait() != 0
    assert "the middleware has stopped" in process.log
    assert "panicked" not in process.log
