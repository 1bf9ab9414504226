//! The receptacle before the probe tip, as a message.

use crate::messages::{Header, ReceptacleState, Vector3};
use crate::refuelling::{Assessment, EnvelopeState, ReceptacleEstimate};

/// Returns the message of a receptacle and its envelope.
#[must_use]
pub fn receptacle(
    header: Header,
    receptacle: &ReceptacleEstimate,
    assessment: &Assessment,
) -> ReceptacleState {
    let vector = |v: &nalgebra::Vector3<f64>| Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    };
    let (ahead, closing) = (
        receptacle.distance_ahead_m(),
        receptacle.closing_speed_mps(),
    );
    ReceptacleState {
        header,
        position: vector(&receptacle.receptacle_from_probe),
        velocity: vector(&receptacle.velocity_in_receiver),
        covariance: std::array::from_fn(|i| receptacle.covariance[(i / 6, i % 6)]),
        distance: receptacle.receptacle_from_probe.norm(),
        distance_ahead: ahead.value,
        distance_ahead_sigma: ahead.sigma,
        closing_speed: closing.value,
        closing_speed_sigma: closing.sigma,
        envelope: match assessment.state {
            EnvelopeState::Outside => ReceptacleState::ENVELOPE_OUTSIDE,
            EnvelopeState::PreContact => ReceptacleState::ENVELOPE_PRE_CONTACT,
            EnvelopeState::Contact => ReceptacleState::ENVELOPE_CONTACT,
        },
        probability_outside: assessment.outside,
        probability_pre_contact: assessment.pre_contact,
        probability_contact: assessment.contact,
    }
}
