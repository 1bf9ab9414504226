//! A track or a candidate for one: how it begins with a frame, and what the next frame makes of it.

use nalgebra::{Matrix6, Vector3};

use super::follower::{Follower, Step};
use super::frame::{Frame, Measured};
use super::lag::{Lag, MEMORY_FRAMES};
use super::lasting::Lasting;
use super::model::{
    BlockMotion, Blocks, Difference, Innovation, Noise, Transition, add_noise, advance,
};
use super::settings::Checked;
use super::track::{Track, seconds};

/// Why a pose does not correct a track or candidate.
pub(super) enum Refused {
    Contradicts { innovation_squared: f64 },
    LostPrecision,
}

/// A track, or a candidate for one.
#[derive(Debug, PartialEq)]
pub(super) struct State<F: Follower> {
    pub(super) motion: StateMotion,
    pub(super) lasting: Lasting,
    pub(super) follower: F,
}

/// The part of a state that has one size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StateMotion {
    pub(super) stamp_ns: i64,
    /// Its covariance is that given the lasting causes.
    pub(super) given_causes: BlockMotion,
    pub(super) consistent_frames: u32,
    pub(super) lag: Lag,
}

impl<F: Follower> State<F> {
    /// Returns the motion with its whole covariance.
    pub(super) fn track(&self) -> Track {
        let mut motion = self.motion.given_causes.motion();
        self.lasting.add_to(&mut motion.covariance);
        Track {
            stamp_ns: self.motion.stamp_ns,
            motion,
        }
    }
}

impl<F: Follower> Clone for State<F> {
    fn clone(&self) -> Self {
        Self {
            motion: self.motion,
            lasting: self.lasting.clone(),
            follower: self.follower.clone(),
        }
    }

    // Beliefs are copied for every frame: the memory is used again.
    fn clone_from(&mut self, source: &Self) {
        self.motion = source.motion;
        self.lasting.clone_from(&source.lasting);
        self.follower.copy_from(&source.follower);
    }
}

impl Checked {
    pub(super) fn noise(&self, lag: &Lag) -> &Noise {
        if lag.is_manoeuvring() {
            &self.manoeuvre_noise
        } else {
            &self.noise
        }
    }

    /// Makes a state the candidate that begins with a frame.
    pub(super) fn begin<F: Follower>(
        &self,
        state: &mut Option<State<F>>,
        frame: &Frame<F::Input>,
        measured: &Measured,
    ) {
        let (mut lasting, mut follower) = state
            .take()
            .map_or_else(Default::default, |state| (state.lasting, state.follower));
        follower.begin(&frame.input);
        let mut covariance = Blocks {
            pose: measured.noise.0 + lasting.start(&frame.lasting),
            cross: Matrix6::zeros(),
            rates: Matrix6::zeros(),
        };
        for axis in 0..3 {
            covariance.rates[(axis, axis)] = self.initial_speed_variance;
            covariance.rates[(3 + axis, 3 + axis)] = self.initial_rate_variance;
        }
        let motion = StateMotion {
            stamp_ns: frame.stamp_ns,
            given_causes: BlockMotion {
                b_from_a: measured.camera_from_tanker,
                velocity_in_b: Vector3::zeros(),
                rate_in_b: Vector3::zeros(),
                covariance,
            },
            consistent_frames: 1,
            lag: Lag::default(),
        };
        *state = Some(State {
            motion,
            lasting,
            follower,
        });
    }
}

/// Corrects a track or candidate by a pose after it, and returns the squared innovation.
///
/// # Inputs
/// * `after`: takes what is believed then; without meaning where the pose is refused. Its memory is used again.
pub(super) fn step<F: Follower>(
    checked: &Checked,
    before: &State<F>,
    after: &mut Option<State<F>>,
    frame: &Frame<F::Input>,
    measured: &Measured,
) -> Result<f64, Refused> {
    let StateMotion {
        stamp_ns,
        given_causes,
        consistent_frames,
        lag,
    } = &before.motion;
    let after = after.get_or_insert_with(|| State {
        motion: before.motion,
        lasting: Lasting::default(),
        follower: F::default(),
    });
    let lasting = &mut after.lasting;
    let gap_s = seconds(frame.stamp_ns, *stamp_ns);
    let transition = Transition::new(given_causes, gap_s);
    let mut predicted = advance(given_causes, &transition, checked.noise(lag));
    let difference = Difference::new(&predicted, &measured.camera_from_tanker);
    lasting.predict_from(
        &before.lasting,
        gap_s,
        &transition,
        &mut predicted.covariance,
    );
    let noise = measured.noise.0 + lasting.see(&frame.lasting, &difference.turn);
    let sums = lasting.sums();
    let innovate = |from: &BlockMotion| {
        Innovation::new(&difference, &from.covariance.pose, &noise, sums.as_ref())
            .ok_or(Refused::LostPrecision)
    };
    let mut innovation = innovate(&predicted)?;
    let innovation_squared = innovation.squared;
    if innovation_squared > checked.gate {
        return Err(Refused::Contradicts { innovation_squared });
    }
    let next_lag = lag.with(&innovation.whitened, gap_s, checked.lag_limit);
    if next_lag.is_manoeuvring() && !lag.is_manoeuvring() {
        // It has lagged since it began to lean, so the larger noise is owed for that time too.
        add_noise(
            &mut predicted,
            MEMORY_FRAMES * gap_s,
            &checked.manoeuvre_noise,
        );
        innovation = innovate(&predicted)?;
    }
    let correction = innovation
        .correct(&predicted, sums.as_ref())
        .ok_or(Refused::LostPrecision)?;
    lasting.correct(&correction);
    let step = Step {
        dt_s: gap_s,
        transition: &transition,
        difference: &difference,
        innovation: &innovation,
        predicted: &predicted,
        correction: &correction,
        checked,
    };
    after.follower.follow(&before.follower, &step, &frame.input);
    after.motion = StateMotion {
        stamp_ns: frame.stamp_ns,
        given_causes: correction.motion,
        consistent_frames: consistent_frames.saturating_add(1),
        lag: next_lag,
    };
    Ok(innovation_squared)
}
