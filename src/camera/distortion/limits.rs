//! Limits of validity of the lens models.

/// Least stretch of a valid lens model, relative to that in the image centre.
///
/// At the turning point the stretch is 0 and the ray of a pixel is undetermined. At this limit a ray is a thousand
/// times as uncertain as in the centre and the inverse has lost three of its sixteen digits. The resulting disc is
/// about a thousandth smaller than that to the turning point.
pub(super) const MIN_STRETCH: f64 = 1.0e-3;

/// Largest radial stretch of a valid rational lens model, relative to that in the image centre.
///
/// Real lenses stay within a factor of about three. A larger stretch means a nearby pole of the rational model, where
/// the whole plane beyond the image is compressed into a thin ring of rays.
pub(super) const MAX_STRETCH: f64 = 10.0;

/// Widest angle off the axis, rad: near 90° a ray leaves the plane `z = 1`.
pub(super) const MAX_ANGLE: f64 = 89.0 * std::f64::consts::PI / 180.0;
