//! Outside, pre-contact or contact window: the region of the receptacle, with probabilities.

use nalgebra::{Matrix3, Vector3};

use super::probability::{Section, region_probability};

/// A region about the probe tip, in the receiver's axes (FLU), m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// An axis-aligned box between two corners.
    Box {
        /// The smallest coordinates.
        min: Vector3<f64>,
        /// The largest.
        max: Vector3<f64>,
    },
    /// A cylinder about the receiver's x axis through the probe tip.
    Cylinder {
        /// Its least x.
        min_x_m: f64,
        /// Its largest x.
        max_x_m: f64,
        /// Its radius.
        radius_m: f64,
    },
}

/// The region of the receptacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EnvelopeState {
    /// In neither region.
    Outside,
    /// In the pre-contact region but not in the contact window.
    PreContact,
    /// In the contact window.
    Contact,
}

/// The regions of an approach. The contact window is inside the pre-contact region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope {
    pre_contact: Region,
    contact: Region,
}

/// State and probabilities, which add up to one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assessment {
    /// The region of the estimated position, regardless of its covariance.
    pub state: EnvelopeState,
    /// Probability of [`EnvelopeState::Outside`].
    pub outside: f64,
    /// Probability of [`EnvelopeState::PreContact`].
    pub pre_contact: f64,
    /// Probability of [`EnvelopeState::Contact`].
    pub contact: f64,
}

/// Why regions cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EnvelopeError {
    /// Limits that are not finite or describe an empty region.
    #[error("expected finite limits with the smaller first and a radius above zero, got {0:?}")]
    EmptyRegion(Region),
    /// The contact window extends beyond the pre-contact region.
    #[error(
        "expected the contact window inside the pre-contact region, got {contact:?} and {pre_contact:?}"
    )]
    NotNested {
        /// The contact window.
        contact: Region,
        /// The pre-contact region.
        pre_contact: Region,
    },
}

impl Region {
    /// Returns whether a position is inside or on the border.
    #[must_use]
    pub fn contains(&self, position: &Vector3<f64>) -> bool {
        match self {
            Self::Box { min, max } => (0..3).all(|i| (min[i]..=max[i]).contains(&position[i])),
            Self::Cylinder {
                min_x_m,
                max_x_m,
                radius_m,
            } => {
                (*min_x_m..=*max_x_m).contains(&position.x)
                    && position.y.hypot(position.z) <= *radius_m
            }
        }
    }

    /// Returns the probability that a normally distributed position is inside.
    ///
    /// Numerical, to 2e-6, or to 1e-4 for nearly singular covariances: integrated adaptively along x and y, in closed
    /// form along z. Each axis is widened by a micrometre, so that singular covariances are allowed. NaN if the
    /// covariance is not finite or has a negative variance.
    #[must_use]
    pub fn probability(&self, mean: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
        let (x_m, section) = match *self {
            Self::Box { min, max } => (
                (min.x, max.x),
                Section::Rectangle {
                    y_m: (min.y, max.y),
                    z_m: (min.z, max.z),
                },
            ),
            Self::Cylinder {
                min_x_m,
                max_x_m,
                radius_m,
            } => ((min_x_m, max_x_m), Section::Disc { radius_m }),
        };
        region_probability(x_m, section, mean, covariance)
    }

    fn is_usable(&self) -> bool {
        let usable = |low: f64, high: f64| low.is_finite() && high.is_finite() && low < high;
        match *self {
            Self::Box { min, max } => (0..3).all(|i| usable(min[i], max[i])),
            Self::Cylinder {
                min_x_m,
                max_x_m,
                radius_m,
            } => usable(min_x_m, max_x_m) && usable(0.0, radius_m),
        }
    }

    /// Returns the corners of the smallest box around it.
    fn corners(&self) -> (Vector3<f64>, Vector3<f64>) {
        match *self {
            Self::Box { min, max } => (min, max),
            Self::Cylinder {
                min_x_m,
                max_x_m,
                radius_m,
            } => (
                Vector3::new(min_x_m, -radius_m, -radius_m),
                Vector3::new(max_x_m, radius_m, radius_m),
            ),
        }
    }

    /// Returns whether all of `inner` is inside.
    fn encloses(&self, inner: &Self) -> bool {
        let (low, high) = inner.corners();
        match (self, inner) {
            (
                Self::Cylinder { radius_m, .. },
                Self::Cylinder {
                    radius_m: inner_radius_m,
                    ..
                },
            ) => {
                inner_radius_m <= radius_m
                    && self.contains(&Vector3::new(low.x, 0.0, 0.0))
                    && self.contains(&Vector3::new(high.x, 0.0, 0.0))
            }
            // Both are convex, so the corners of a box are sufficient.
            _ => (0..8).all(|corner| {
                let pick = |axis: usize| {
                    if corner >> axis & 1 == 0 {
                        low[axis]
                    } else {
                        high[axis]
                    }
                };
                self.contains(&Vector3::new(pick(0), pick(1), pick(2)))
            }),
        }
    }
}

impl Envelope {
    /// Returns an envelope of checked regions.
    ///
    /// # Errors
    /// [`EnvelopeError`]: an empty region, or a contact window that extends beyond the pre-contact region.
    pub fn new(pre_contact: Region, contact: Region) -> Result<Self, EnvelopeError> {
        for region in [pre_contact, contact] {
            if !region.is_usable() {
                return Err(EnvelopeError::EmptyRegion(region));
            }
        }
        if !pre_contact.encloses(&contact) {
            return Err(EnvelopeError::NotNested {
                contact,
                pre_contact,
            });
        }
        Ok(Self {
            pre_contact,
            contact,
        })
    }

    /// Returns state and probabilities of a position, as in [`super::ReceptacleEstimate`].
    #[must_use]
    pub fn assess(&self, position: &Vector3<f64>, covariance: &Matrix3<f64>) -> Assessment {
        let contact = self.contact.probability(position, covariance);
        let either = self
            .pre_contact
            .probability(position, covariance)
            .max(contact);
        let state = if self.contact.contains(position) {
            EnvelopeState::Contact
        } else if self.pre_contact.contains(position) {
            EnvelopeState::PreContact
        } else {
            EnvelopeState::Outside
        };
        Assessment {
            state,
            outside: 1.0 - either,
            pre_contact: either - contact,
            contact,
        }
    }
}
