"""Pinhole cameras with the distortion models that ROS names, straight from their definitions."""

from dataclasses import dataclass, field

import numpy as np

from harness.rotations import Array


@dataclass(frozen=True)
class Camera:
    """Intrinsics in pixels and a distortion model with its coefficients in ROS order."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    model: str = "plumb_bob"
    d: tuple[float, ...] = field(default=(0.0, 0.0, 0.0, 0.0, 0.0))

    def project(self, points_in_camera: Array) -> Array:
        """Pixels (u, v), one row a point, of points given in the optical frame (z ahead).

        A point behind the camera projects through the centre, as the bare formula has it: tests
        of the cheirality check need such pixels.
        """
        ray = points_in_camera[:, :2] / points_in_camera[:, 2:]
        distorted = DISTORT[self.model](ray, self.d) if any(self.d) else ray
        return distorted * [self.fx, self.fy] + [self.cx, self.cy]

    def sees(self, pixels: Array, margin_px: float = 0.0) -> bool:
        """Whether every pixel lies in the image, at least `margin_px` away from its border."""
        low = margin_px
        high = np.array([self.width, self.height]) - 1 - margin_px
        return bool(np.all(pixels >= low) and np.all(pixels <= high))


def plumb_bob(ray: Array, d: tuple[float, ...]) -> Array:
    """Brown's model, (k1, k2, p1, p2, k3)."""
    k1, k2, p1, p2, k3 = d
    return _radial_tangential(ray, lambda r2: 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), p1, p2)


def rational_polynomial(ray: Array, d: tuple[float, ...]) -> Array:
    """Brown's model with a denominator, (k1, k2, p1, p2, k3, k4, k5, k6)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = d

    def radial(r2: Array) -> Array:
        above = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        return above / below

    return _radial_tangential(ray, radial, p1, p2)


def equidistant(ray: Array, d: tuple[float, ...]) -> Array:
    """Kannala and Brandt's fisheye, (k1, k2, k3, k4): a polynomial in the angle off the axis."""
    k1, k2, k3, k4 = d
    r = np.linalg.norm(ray, axis=1, keepdims=True)
    theta = np.arctan(r)
    t2 = theta**2
    theta_d = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    return ray * np.divide(theta_d, r, out=np.ones_like(r), where=r > 1e-12)


def _radial_tangential(ray: Array, radial, p1: float, p2: float) -> Array:
    x, y = ray[:, :1], ray[:, 1:]
    r2 = x**2 + y**2
    return np.hstack(
        [
            x * radial(r2) + 2 * p1 * x * y + p2 * (r2 + 2 * x**2),
            y * radial(r2) + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y,
        ]
    )


DISTORT = {
    "plumb_bob": plumb_bob,
    "rational_polynomial": rational_polynomial,
    "equidistant": equidistant,
}

# One lens of each kind, bent by many pixels at the border of the paper's image.
LENSES: dict[str, tuple[float, ...]] = {
    "plumb_bob": (-0.28, 0.09, 0.0008, -0.0005, -0.012),
    "rational_polynomial": (0.35, -0.12, 0.0006, -0.0004, 0.02, 0.62, -0.05, 0.03),
    "equidistant": (-0.02, 0.006, -0.003, 0.0005),
}
