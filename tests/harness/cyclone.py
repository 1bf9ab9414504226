"""A peer on Eclipse Cyclone DDS: no ROS in it, the same topics and services on the wire.

`rmw_cyclonedds` is not on PyPI, the middleware below it is. The types are made from the .msg texts, under the names
that ROS gives them in DDS; the services have the 16 bytes in front that `rmw_cyclonedds` puts there.
"""

import itertools
from functools import cache
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from harness.typestore import typestore
from harness.waiting import wait_until

# This host alone, as the node under test.
_ONLY_LOOPBACK = """
<CycloneDDS><Domain Id="any"><General>
  <Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>
</General></Domain></CycloneDDS>
"""
_RELIABLE = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(100)
)
_BASE = {"bool": bool, "string": str, "byte": types.uint8} | {
    name: getattr(types, name)
    for name in [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
    + ["float32", "float64"]
}


def _name_in_dds(name: str) -> str:
    package, kind, name = name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def _field(node: tuple[Nodetype, Any]) -> Any:
    kind, what = node
    match kind:
        case Nodetype.BASE:
            return _BASE[what[0]]
        case Nodetype.NAME:
            return idl_type(what)
        case Nodetype.ARRAY:
            return types.array[_field(what[0]), what[1]]
        case Nodetype.SEQUENCE:
            return types.sequence[_field(what[0])]


@cache
def idl_type(name: str) -> type[IdlStruct]:
    """The type of a message such as `std_msgs/msg/Header`."""
    fields = {field: _field(node) for field, node in typestore().fielddefs[name][1]}
    return make_idl_struct(name.replace("/", "_"), _name_in_dds(name), fields)


def _part_of_service(name: str, definition: str) -> type[IdlStruct]:
    """The request or the response of a service, behind its identity."""
    (_, defined), = get_types_from_msg(definition, name).values()
    fields = {"client": types.uint64, "number": types.int64}
    fields |= {field: _field(node) for field, node in defined}
    return make_idl_struct(name.replace("/", "_"), _name_in_dds(name), fields)


class CyclonePeer:
    """A participant, with what has arrived."""

    def __init__(self, domain: int) -> None:
        self._domain = Domain(domain, _ONLY_LOOPBACK)
        self._participant = DomainParticipant(domain)
        self._numbers = itertools.count(1)

    def _topic(self, name: str, kind: type[IdlStruct]) -> Topic:
        return Topic(self._participant, name, kind)

    def publisher(self, topic: str, message_type: str) -> DataWriter:
        """A reliable publisher of a ROS topic."""
        return DataWriter(
            self._participant, self._topic(f"rt{topic}", idl_type(message_type)), qos=_RELIABLE
        )

    def subscription(self, topic: str, message_type: str) -> DataReader:
        """A reliable subscription to a ROS topic."""
        return DataReader(
            self._participant, self._topic(f"rt{topic}", idl_type(message_type)), qos=_RELIABLE
        )

    def call(self, service: str, service_type: str, request: str, response: str, **fields: Any) -> Any:
        """The response of a service; `request` and `response` are what its .srv says of them."""
        asked, answered = (
            _part_of_service(f"{service_type}_{part}", text)
            for part, text in (("Request", request), ("Response", response))
        )
        writer = DataWriter(
            self._participant, self._topic(f"rq{service}Request", asked), qos=_RELIABLE
        )
        reader = DataReader(
            self._participant, self._topic(f"rr{service}Reply", answered), qos=_RELIABLE
        )
        wait_until(
            lambda: writer.get_matched_subscriptions() and reader.get_matched_publications(),
            f"the service {service}",
        )
        client, number = 0x0123_4567_89AB_CDEF, next(self._numbers)
        replies: list[Any] = []

        def is_answered() -> bool:
            replies.extend(reader.take(10))
            return any((reply.client, reply.number) == (client, number) for reply in replies)

        writer.write(asked(client=client, number=number, **fields))
        wait_until(is_answered, f"the reply of {service}")
        return next(reply for reply in replies if reply.number == number)
