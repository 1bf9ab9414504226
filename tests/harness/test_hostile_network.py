"""What anyone on the network can send to the node's ports: it stays up, stays right, and does not grow without end."""

import itertools
import socket

import numpy as np

from harness import messages
from harness.burden import MEBIBYTE, Burden
from harness.estimator import Estimator
from harness.rtps_packets import hostile, participant, udp_ports

PACKETS = 20_000
# What fits the receive buffer of a socket, so that all of it is looked at and our own frames are not crowded out.
BURST = 50
PARTICIPANTS = 2_000
LEASE_S = 3
MOST_GROWTH = 40 * MEBIBYTE
# Of the middleware about what it could not read: a burst, and one a second.
MOST_LINES = 200


def send_bursts(estimator: Estimator, packets: list[bytes]) -> None:
    """Sends to every port of the node in turn, with frames in between that must be answered rightly."""
    ports = itertools.cycle(udp_ports(estimator.process.pid))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for begin in range(0, len(packets), BURST):
            for packet in packets[begin : begin + BURST]:
                sender.sendto(packet, ("127.0.0.1", next(ports)))
            estimator.expect_pose(messages.exact_frame(estimator.next_index()))


def test_random_and_mutated_packets_do_not_keep_the_node_from_its_frames(
    estimator: Estimator, rng: np.random.Generator
) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    before = Burden.of(estimator.process)

    send_bursts(estimator, list(itertools.islice(hostile(rng), PACKETS)))

    # A thread of the middleware that has panicked would be missing.
    after = Burden.of(estimator.process)
    assert after.threads == before.threads, estimator.process.log
    assert "panicked" not in estimator.process.log, estimator.process.log
    assert len(estimator.process.log.splitlines()) < MOST_LINES
    grown = after.memory - before.memory
    print(f"{PACKETS} packets: grown by {grown / MEBIBYTE:.1f} MiB")
    assert grown < MOST_GROWTH


def test_participants_that_do_not_exist_cost_no_frame_and_little_memory(
    estimator: Estimator, rng: np.random.Generator
) -> None:
    estimator.expect_pose(messages.exact_frame(estimator.next_index()))
    before = Burden.of(estimator.process)

    for round_number in range(3):
        send_bursts(estimator, [participant(rng.bytes(12), 9, LEASE_S) for _ in range(PARTICIPANTS)])
        grown = Burden.of(estimator.process).memory - before.memory
        print(f"round {round_number}: grown by {grown / MEBIBYTE:.1f} MiB")
        estimator.peer.spin_for(2 * LEASE_S)

    assert Burden.of(estimator.process).threads == before.threads, estimator.process.log
    assert "panicked" not in estimator.process.log, estimator.process.log
    assert grown < MOST_GROWTH
