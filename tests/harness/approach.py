"""A receiver that nears the tanker in a slow turn, told to the node, and the truth of what flight stacks should hear."""

from dataclasses import dataclass

import numpy as np
from px4_msgs.msg import VehicleAttitude
from geometry_msgs.msg import Quaternion
from sensor_msgs.msg import Imu
from std_msgs.msg import Header

from harness import messages, paper
from harness.processes import REPOSITORY
from harness.rotations import Array, Pose, about_x, about_y, about_z, to_quaternion
from harness.sinks import FRD_FROM_FLU, NED_FROM_ENU

SETUP = REPOSITORY / "config" / "refuelling" / "example.yaml"
# As that file has it, m.
CAMERA_IN_RECEIVER = np.array([1.0, 0.0, 0.8])
PROBE_TIP_IN_RECEIVER = np.array([5.0, -0.5, 1.0])
RECEPTACLE_IN_TANKER = np.array([-4.0, 0.0, -2.5])

# Attitudes come with every index (50 Hz), images with every fifth (10 Hz).
STRIDE = 5
FRAMES = 200
_PERIOD_S = messages.FRAME_PERIOD_NS * 1e-9
_LAST = FRAMES * STRIDE
# Of the tanker's origin from the camera, in receiver axes, m.
_FAR = np.array([45.0, 0.5, 6.0])
_NEAR = np.array([15.0, 0.0, 4.5])


@dataclass(frozen=True)
class Truth:
    """What is true at an index: a whole number for messages, anything between for derivatives."""

    index: float

    @property
    def camera_from_tanker(self) -> Pose:
        share = self.index / _LAST
        return paper.camera_from_tanker(1.0, 2.0, 3.0, tuple(_FAR + share * (_NEAR - _FAR)))

    @property
    def ned_from_frd(self) -> Array:
        # Three degrees a second to the right, nose up, right wing down.
        yaw = np.radians(40.0 + 3.0 * self.index * _PERIOD_S)
        return about_z(yaw) @ about_y(np.radians(4.0)) @ about_x(np.radians(9.0))

    @property
    def receptacle_in_receiver(self) -> Array:
        in_camera = self.camera_from_tanker.transform(RECEPTACLE_IN_TANKER[None, :])[0]
        return paper.CAMERA_FROM_RECEIVER.T @ in_camera + CAMERA_IN_RECEIVER

    @property
    def from_probe(self) -> Array:
        return self.receptacle_in_receiver - PROBE_TIP_IN_RECEIVER

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
        x, y, z, w = to_quaternion(self.ned_from_frd)
        return VehicleAttitude(
            timestamp=self.stamp_us,
            timestamp_sample=self.stamp_us,
            q=np.array([w, x, y, z], dtype=np.float32),
        )

    @property
    def imu(self) -> Imu:
        x, y, z, w = to_quaternion(NED_FROM_ENU.T @ self.ned_from_frd @ FRD_FROM_FLU)
        return Imu(
            header=Header(stamp=messages.stamp_of(int(self.index)), frame_id="base_link"),
            orientation=Quaternion(x=x, y=y, z=z, w=w),
        )
