"""The message types of bags, tanker_pose's among them, known to rosbags without a ROS installation."""

from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

# The .msg files of this package; in a workspace `ros2 pkg prefix --share tanker_pose` has them too.
MESSAGES = Path(__file__).resolve().parents[2] / "msg"


def typestore() -> Typestore:
    """ROS 2's own types with those of tanker_pose added."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for path in sorted(MESSAGES.glob("*.msg")):
        types |= get_types_from_msg(path.read_text(encoding="utf-8"), f"tanker_pose/msg/{path.stem}")
    store.register(types)
    return store
