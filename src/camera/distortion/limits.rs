//! Where lens models stop being valid.

/// Least stretch at which a lens model still counts as valid, as a part of that in the image centre.
///
/// At the turning point the stretch is 0 and the ray of a pixel undetermined. Here a ray is a thousand
/// times as uncertain as in the centre and the inverse has lost three of its sixteen digits. The disc
/// to this limit is about a thousandth smaller than that to the turning point.
pub(super) const MIN_STRETCH: f64 = 1.0e-3;

/// Largest radial stretch at which a rational lens model still counts as valid, as a part of that in the image centre.
///
/// Lenses stay within a factor of three or so. More is the way up to a pole of a rational model, on which all of the
/// plane beyond the image is squeezed into a thin ring of rays.
pub(super) const MAX_STRETCH: f64 = 10.0;

/// Widest angle off the axis, rad: near 90° a ray leaves the plane `z = 1`.
pub(super) const MAX_ANGLE: f64 = 89.0 * std::f64::consts::PI / 180.0;
