"""A receiver that nears the tanker in a slow turn up to contact, told to the node, and what flight stacks should hear.

The flight leaves no convention without effect: metres to the side and above, a tanker that is turned by tens of
degrees about all axes and turns on at degrees a second, a receiver that banks, climbs and turns.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from px4_msgs.msg import VehicleAttitude
from geometry_msgs.msg import Quaternion, Vector3
from sensor_msgs.msg import Imu
from std_msgs.msg import Header

from harness import messages, paper
from harness.camera_model import Camera
from harness.processes import REPOSITORY
from harness.rotations import Array, Pose, about_x, about_y, about_z, to_quaternion
from harness.sinks import FRD_FROM_FLU, NED_FROM_ENU

SETUP = REPOSITORY / "config" / "refuelling" / "example.yaml"
# As that file has it, m.
CAMERA_IN_RECEIVER = np.array([1.0, 0.0, 0.8])
PROBE_TIP_IN_RECEIVER = np.array([5.0, -0.5, 1.0])
RECEPTACLE_IN_TANKER = np.array([-4.0, 0.0, -2.5])
PRE_CONTACT = np.array([[-0.5, -2.0, -2.0], [8.0, 2.0, 2.0]])
CONTACT_FROM_X, CONTACT_TO_X, CONTACT_RADIUS = -0.1, 0.4, 0.25

# Wide enough for all markers of the paper's tanker in contact, 8 m from the camera.
CAMERA = Camera(fx=800.0, fy=800.0, cx=799.5, cy=599.5, width=1600, height=1200)

# Attitudes come with every index (50 Hz), images with every fifth (10 Hz).
STRIDE = 5
FRAMES = 200
_PERIOD_S = messages.FRAME_PERIOD_NS * 1e-9
_LAST = FRAMES * STRIDE
# Of the receptacle from the probe tip, in receiver axes, m; straight and at one speed.
_FAR = np.array([20.0, 3.0, -2.4])
_NEAR = np.array([0.0, 0.03, -0.02])
# Of the tanker against the receiver, deg and deg/s: roll, pitch, yaw.
_ANGLES_DEG = np.array([18.0, -12.0, 25.0])
_RATES_DPS = np.array([-1.0, 0.9, -1.8])
# Of the receiver about down, deg/s.
_TURN_DPS = 3.0


def exact_setup(directory: Path) -> Path:
    """The example's setup for aircraft that are exactly as it says: nothing of it adds to covariances."""
    text = SETUP.read_text(encoding="utf-8")
    for stated, exact in [
        ("{position_m: 0.005, attitude_deg: 0.1}", "{position_m: 0.0, attitude_deg: 0.0}"),
        ("receptacle_sigma: {x: 0.02, y: 0.02, z: 0.02}", "receptacle_sigma: {x: 0.0, y: 0.0, z: 0.0}"),
    ]:
        assert stated in text
        text = text.replace(stated, exact)
    path = directory / "exact.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@dataclass(frozen=True)
class Truth:
    """What is true at an index: a whole number for messages, anything between for derivatives."""

    index: float

    @property
    def receiver_from_tanker(self) -> Array:
        roll, pitch, yaw = np.radians(_ANGLES_DEG + _RATES_DPS * self.index * _PERIOD_S)
        return about_z(yaw) @ about_y(pitch) @ about_x(roll)

    @property
    def camera_from_tanker(self) -> Pose:
        receptacle = self.receptacle_in_receiver - CAMERA_IN_RECEIVER
        tanker = receptacle - self.receiver_from_tanker @ RECEPTACLE_IN_TANKER
        return Pose(
            rotation=paper.CAMERA_FROM_RECEIVER @ self.receiver_from_tanker,
            translation=paper.CAMERA_FROM_RECEIVER @ tanker,
        )

    @property
    def ned_from_frd(self) -> Array:
        # Three degrees a second to the right, nose up, right wing down.
        yaw = np.radians(40.0 + _TURN_DPS * self.index * _PERIOD_S)
        return about_z(yaw) @ about_y(np.radians(4.0)) @ about_x(np.radians(9.0))

    @property
    def from_probe(self) -> Array:
        return _FAR + self.index / _LAST * (_NEAR - _FAR)

    @property
    def receptacle_in_receiver(self) -> Array:
        return self.from_probe + PROBE_TIP_IN_RECEIVER

    @property
    def tanker_in_receiver(self) -> Array:
        """Its origin."""
        return self.receptacle_in_receiver - self.receiver_from_tanker @ RECEPTACLE_IN_TANKER

    @property
    def in_frd(self) -> Array:
        return FRD_FROM_FLU @ self.receptacle_in_receiver

    @property
    def in_ned(self) -> Array:
        return self.ned_from_frd @ self.in_frd

    def rate_of(self, name: str) -> Array:
        """The derivative of a vector, by central differences."""
        step = 1e-3
        after, before = Truth(self.index + step), Truth(self.index - step)
        return (getattr(after, name) - getattr(before, name)) / (2 * step * _PERIOD_S)

    @property
    def stamp_us(self) -> int:
        stamp = messages.stamp_of(int(self.index))
        return stamp.sec * 1_000_000 + stamp.nanosec // 1000

    @property
    def vehicle_attitude(self) -> VehicleAttitude:
        return self.vehicle_attitude_with(np.eye(3))

    def vehicle_attitude_with(self, heading: Array, resets: int = 0) -> VehicleAttitude:
        """What PX4 says after it has corrected its heading by a rotation."""
        x, y, z, w = to_quaternion(heading @ self.ned_from_frd)
        return VehicleAttitude(
            timestamp=self.stamp_us,
            timestamp_sample=self.stamp_us,
            q=np.array([w, x, y, z], dtype=np.float32),
            quat_reset_counter=resets,
        )

    @property
    def imu(self) -> Imu:
        x, y, z, w = to_quaternion(NED_FROM_ENU.T @ self.ned_from_frd @ FRD_FROM_FLU)
        # A turn about down, in FLU.
        p, q, r = FRD_FROM_FLU @ self.ned_from_frd.T @ [0.0, 0.0, np.radians(_TURN_DPS)]
        return Imu(
            header=Header(stamp=messages.stamp_of(int(self.index)), frame_id="base_link"),
            orientation=Quaternion(x=x, y=y, z=z, w=w),
            angular_velocity=Vector3(x=p, y=q, z=r),
        )
