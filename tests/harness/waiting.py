"""Bounded waiting: every wait has an end, and says what it waited for."""

import time
from collections.abc import Callable

# A loaded two-core machine needs seconds for what takes 0.1 s on a quiet one.
PATIENCE_S = 15.0
POLL_S = 0.01


def wait_until(
    condition: Callable[[], bool],
    what: str,
    *,
    timeout_s: float = PATIENCE_S,
    pause: Callable[[], object] = lambda: time.sleep(POLL_S),
) -> None:
    """Returns as soon as `condition` holds; fails the test, naming `what`, when it never does."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"waited {timeout_s:g} s in vain for {what}")
        pause()
