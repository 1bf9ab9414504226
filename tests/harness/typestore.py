"""The message types that bags hold, known to rosbags from their .msg texts."""

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from harness.processes import REPOSITORY


def typestore() -> Typestore:
    """ROS 2's own types with those of msg/ added."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for path in sorted((REPOSITORY / "msg").glob("*.msg")):
        types |= get_types_from_msg(
            path.read_text(encoding="utf-8"), f"tanker_pose/msg/{path.stem}"
        )
    store.register(types)
    return store
