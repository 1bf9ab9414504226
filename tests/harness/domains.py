"""A ROS domain for every test, shared with no other test of this run or of a run beside it."""

import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Domain 0 belongs to people; above 101 the discovery ports reach Linux's ephemeral ports.
FIRST_DOMAIN = 1
LAST_DOMAIN = 101
_COUNT = LAST_DOMAIN - FIRST_DOMAIN + 1
# Unicast discovery ports of a domain's first participants, RTPS 9.6.1: a node of somebody's listens there.
_PARTICIPANTS = 4

_next_offset = os.getpid()


def _is_quiet(domain: int) -> bool:
    """Whether no participant of this host listens in a domain: tests must not reconfigure somebody's node."""
    for participant in range(_PARTICIPANTS):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7400 + 250 * domain + 10 + 2 * participant))
            except OSError:
                return False
    return True


@contextmanager
def claimed_domain() -> Iterator[int]:
    """Yields a domain id, held by a file lock until the test ends (a killed run lets go too)."""
    global _next_offset
    locks = Path(tempfile.gettempdir()) / "tanker_pose_harness_domains"
    locks.mkdir(mode=0o777, exist_ok=True)
    for _ in range(_COUNT):
        domain = FIRST_DOMAIN + _next_offset % _COUNT
        _next_offset += 1
        with (locks / str(domain)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if not _is_quiet(domain):
                continue
            yield domain
            return
    raise RuntimeError(f"all {_COUNT} ROS domains are in use")
