"""Packets of RTPS made by hand: participants that do not exist, and what no implementation would send.

Numbers are those of the specification of RTPS 2.3: chapter 8.3 (messages), 9.4 (submessages), 9.6 (discovery).
"""

import struct
from collections.abc import Iterator

import numpy as np
import psutil

_HEADER = b"RTPS\x02\x03\x01\x0f"
_PL_CDR_LE = b"\x00\x03\x00\x00"
_SPDP_WRITER, _SPDP_READER = b"\x00\x01\x00\xc2", b"\x00\x01\x00\xc7"
# Entities that every participant has, and what users' readers and writers look like.
_ENTITIES = [
    b"\x00\x00\x00\x00",
    _SPDP_WRITER,
    _SPDP_READER,
    b"\x00\x00\x03\xc2",
    b"\x00\x00\x03\xc7",
    b"\x00\x00\x04\xc2",
    b"\x00\x00\x04\xc7",
    b"\x00\x02\x00\xc2",
    b"\x00\x02\x00\xc7",
    *(bytes([0, 0, number, kind]) for number in range(24) for kind in (0x03, 0x04)),
]
# ACKNACK, HEARTBEAT, GAP, INFO_TS, INFO_SRC, INFO_DST, NACK_FRAG, HEARTBEAT_FRAG, DATA, DATA_FRAG, and unknown ones.
_KINDS = [0x06, 0x07, 0x08, 0x09, 0x0C, 0x0E, 0x12, 0x13, 0x15, 0x16, 0x00, 0x7F, 0xFF]
_DATA = 0x15
_LONGEST = 300


def udp_ports(pid: int) -> list[int]:
    """The ports at which a process listens."""
    return sorted({socket.laddr.port for socket in psutil.Process(pid).net_connections("udp")})


def _parameter(number: int, value: bytes) -> bytes:
    value += bytes(-len(value) % 4)
    return struct.pack("<HH", number, len(value)) + value


def _locator(port: int) -> bytes:
    return struct.pack("<iI", 1, port) + bytes(12) + bytes([127, 0, 0, 1])


def _submessage(kind: int, flags: int, body: bytes) -> bytes:
    return struct.pack("<BBH", kind, flags, len(body)) + body


def participant(prefix: bytes, port: int, lease_s: int) -> bytes:
    """The announcement of a participant: identity of 12 bytes, port on this host, time until it counts as gone."""
    parameters = [
        (0x0015, b"\x02\x03\x00\x00"),  # protocol version
        (0x0016, b"\x01\x0f\x00\x00"),  # vendor
        (0x0050, prefix + b"\x00\x00\x01\xc1"),  # identity
        (0x0032, _locator(port)),  # metatraffic, unicast
        (0x0031, _locator(port)),  # users' data, unicast
        (0x0002, struct.pack("<iI", lease_s, 0)),
        (0x0058, struct.pack("<I", 0x0000_0C3F)),  # built-in endpoints: all
    ]
    listed = b"".join(_parameter(*one) for one in parameters) + b"\x01\x00\x00\x00"
    data = struct.pack("<HH", 0, 16) + _SPDP_READER + _SPDP_WRITER + struct.pack("<iI", 0, 1)
    return _HEADER + prefix + _submessage(_DATA, 0x05, data + _PL_CDR_LE + listed)


def hostile(rng: np.random.Generator) -> Iterator[bytes]:
    """Packets without end: noise, submessages of random content behind right headers, and mutants of announcements."""
    while True:
        match rng.integers(3):
            case 0:
                yield rng.bytes(int(rng.integers(0, _LONGEST)))
            case 1:
                yield _HEADER + rng.bytes(12) + b"".join(
                    _random_submessage(rng) for _ in range(rng.integers(1, 6))
                )
            case _:
                yield _mutant(participant(rng.bytes(12), 9, 1), rng)


def _random_submessage(rng: np.random.Generator) -> bytes:
    body = bytearray(rng.bytes(int(rng.integers(0, _LONGEST))))
    if len(body) >= 12 and rng.random() < 0.8:
        entities = [_ENTITIES[i] for i in rng.integers(len(_ENTITIES), size=2)]
        # DATA has flags and an offset before them.
        begin = 4 if rng.random() < 0.5 else 0
        body[begin : begin + 8] = b"".join(entities)
    kind = _KINDS[rng.integers(len(_KINDS))]
    whole = bytearray(_submessage(kind, int(rng.integers(256)), bytes(body)))
    if rng.random() < 0.2:
        whole[2:4] = rng.bytes(2)  # a length that is not its own
    return bytes(whole)


def _mutant(packet: bytes, rng: np.random.Generator) -> bytes:
    mutant = bytearray(packet)
    for _ in range(rng.integers(1, 8)):
        at = int(rng.integers(20, len(mutant)))
        match rng.integers(3):
            case 0:
                mutant[at] ^= 1 << int(rng.integers(8))
            case 1:
                mutant[at : at + 4] = b"\xff\xff\xff\x7f"
            case _:
                del mutant[at + 1 :]
    return bytes(mutant)
