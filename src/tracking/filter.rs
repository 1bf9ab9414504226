//! The track: when it begins, what it believes, when it ends.

use nalgebra::{Isometry3, Matrix6, Vector3};

use super::belief::{Belief, State, StateMotion};
use super::history::{Entry, Frame, History, Measured, Place};
use super::lag::{Lag, MEMORY_FRAMES};
use super::lasting::{Lasting, LastingError};
use super::model::{
    Difference, Innovation, Noise, Transition, add_noise, advance, predict, symmetric,
};
use super::outcome::{MeasurementError, PredictError, StartReason, TrackOutcome};
use super::settings::{Checked, CheckedFilterSettings, FilterSettings, FilterSettingsError};
use super::symmetric6::{Factor, rows};
use super::track::{Track, seconds};
use crate::geometry::{Matrix12, Motion, PoseCovariance};

/// Turns poses of single frames into a track. It reads no clock, and allocates only until it has room for the frames of
/// half a second.
///
/// A frame that comes late is taken at its own time, if that is less than 0.5 s behind the last accepted frame and no
/// more than sixty frames are kept since: frames after it are taken again. The track is then the same, bit for bit, as if all frames
/// had come in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    settings: FilterSettings,
    checked: Checked,
    belief: Belief,
    history: History,
    /// Room for a prediction.
    scratch: Lasting,
}

/// Why a pose does not correct a track or candidate.
enum Refused {
    Contradicts { innovation_squared: f64 },
    LostPrecision,
}

impl From<CheckedFilterSettings> for Filter {
    /// Returns a filter without a track.
    fn from(settings: CheckedFilterSettings) -> Self {
        Self {
            checked: settings.checked,
            settings: *settings.settings(),
            belief: Belief::default(),
            history: History::default(),
            scratch: Lasting::default(),
        }
    }
}

impl Filter {
    /// Returns a filter without a track.
    ///
    /// # Errors
    /// [`FilterSettingsError`] names the first setting out of range.
    pub fn new(settings: FilterSettings) -> Result<Self, FilterSettingsError> {
        Ok(Self::from(settings.checked()?))
    }

    /// Returns the settings in force.
    #[must_use]
    pub fn settings(&self) -> &FilterSettings {
        &self.settings
    }

    /// Takes other settings from the next frame on; track and candidate stay. Frames from before cannot come any more.
    pub fn set_settings(&mut self, settings: CheckedFilterSettings) {
        self.history.close(self.accepted_ns());
        self.checked = settings.checked;
        self.settings = *settings.settings();
    }

    /// Forgets track and candidate; the next pose is the first.
    pub fn reset(&mut self) {
        self.belief = Belief::default();
        self.history.clear();
    }

    /// Returns the track at the last accepted frame; `None` while it is not confirmed.
    #[must_use]
    pub fn track(&self) -> Option<Track> {
        self.confirmed().map(State::track)
    }

    /// Returns the motion expected at a stamp, with its covariance: a start for the next estimate.
    ///
    /// # Errors
    /// [`PredictError`]: no track, a stamp before it, or one more than `max_gap_s` after it.
    pub fn predict(&self, stamp_ns: i64) -> Result<Motion, PredictError> {
        let state = self.confirmed().ok_or(PredictError::NoTrack)?;
        let gap_s = seconds(stamp_ns, state.motion.stamp_ns);
        if gap_s < 0.0 {
            return Err(PredictError::BeforeTrack { by_s: -gap_s });
        }
        let limit_s = self.checked.max_gap_s;
        if gap_s > limit_s {
            return Err(PredictError::BeyondGap { gap_s, limit_s });
        }
        let noise = self.checked.noise(&state.motion.lag);
        Ok(predict(&state.track().motion, gap_s, noise))
    }

    /// Takes the pose of one frame and returns what became of it.
    ///
    /// Frames that contradict the track but agree with each other, as many as make a track, end it and are
    /// the next one: a motion that outran the gate is not coasted away from.
    ///
    /// # Inputs
    /// * `stamp_ns`: when the image was taken.
    /// * `camera_from_tanker`, `covariance`: a trusted estimate, whose error is independent of those of
    ///   other frames.
    pub fn update(
        &mut self,
        stamp_ns: i64,
        camera_from_tanker: &Isometry3<f64>,
        covariance: &PoseCovariance,
    ) -> TrackOutcome {
        self.update_with_lasting(stamp_ns, camera_from_tanker, covariance, &[])
    }

    /// Takes the pose of one frame, whose error has parts in common with those of other frames.
    ///
    /// # Inputs
    /// * `stamp_ns`, `camera_from_tanker`: as for [`Self::update`].
    /// * `noise`: covariance of the part of the error that is this frame's own.
    /// * `lasting`: the parts that other frames share. The first 58 of a track are carried one by one, others together
    ///   as constant errors of the pose: those with a time constant and the largest come first.
    pub fn update_with_lasting(
        &mut self,
        stamp_ns: i64,
        camera_from_tanker: &Isometry3<f64>,
        noise: &PoseCovariance,
        lasting: &[LastingError],
    ) -> TrackOutcome {
        if let Err(error) = check(camera_from_tanker, noise, lasting) {
            return TrackOutcome::Invalid(error);
        }
        let measured = Measured {
            camera_from_tanker: *camera_from_tanker,
            noise: self.with_floor(noise),
        };
        self.take(stamp_ns, Some(&measured), lasting)
    }

    /// Takes the stamp of a frame that gave no pose, and returns whether the track outlives it.
    pub fn miss(&mut self, stamp_ns: i64) -> TrackOutcome {
        self.take(stamp_ns, None, &[])
    }

    /// Puts a frame among the others, by its stamp.
    fn take(
        &mut self,
        stamp_ns: i64,
        measured: Option<&Measured>,
        lasting: &[LastingError],
    ) -> TrackOutcome {
        let mut accepted_ns = self.accepted_ns();
        let mut late_by_s = None;
        let at = match self.history.place(stamp_ns, accepted_ns) {
            Place::Newest => self.history.len(),
            Place::Before {
                at,
                late_by_s: by_s,
            } => {
                late_by_s = Some(by_s);
                at
            }
            Place::Seen => return TrackOutcome::Duplicate { stamp_ns },
            Place::TooOld { late_by_s }
                if accepted_ns.is_some() && late_by_s <= self.checked.max_gap_s =>
            {
                return TrackOutcome::Late { late_by_s };
            }
            // The source of the stamps has begun anew, or nothing is believed: what was before is of another time.
            Place::TooOld { .. } => {
                self.history.clear();
                accepted_ns = None;
                0
            }
        };
        let at = self.history.insert(at, stamp_ns, accepted_ns);
        if let Some(entry) = self.history.entry(at) {
            entry.frame.measured = measured.copied();
            entry.frame.lasting.extend_from_slice(lasting);
        }
        // Out, so that its frames can be read while the belief changes.
        let mut history = std::mem::take(&mut self.history);
        if let Some(next) = history.entry(at + 1) {
            self.belief.clone_from(&next.before);
        }
        let mut outcome = None;
        for at in at..history.len() {
            if let Some(Entry { frame, before }) = history.entry(at) {
                before.clone_from(&self.belief);
                let of_frame = self.follow(frame);
                outcome.get_or_insert(of_frame);
            }
        }
        self.history = history;
        let outcome = outcome.unwrap_or(TrackOutcome::Idle);
        let Some(late_by_s) = late_by_s else {
            return outcome;
        };
        TrackOutcome::Inserted {
            late_by_s,
            was_used: measured.is_some() && !matches!(outcome, TrackOutcome::Gated { .. }),
        }
    }

    /// Returns the stamp of the last accepted frame, of a track or a candidate.
    fn accepted_ns(&self) -> Option<i64> {
        Some(self.belief.state.as_ref()?.motion.stamp_ns)
    }

    /// Goes on by one frame, in the order of stamps.
    fn follow(&mut self, frame: &Frame) -> TrackOutcome {
        let stamp_ns = frame.stamp_ns;
        let Some(state) = &mut self.belief.state else {
            return match &frame.measured {
                Some(measured) => self.start(frame, measured, StartReason::First),
                None => TrackOutcome::Idle,
            };
        };
        let gap_s = seconds(stamp_ns, state.motion.stamp_ns);
        let restart = if gap_s > self.checked.max_gap_s {
            Some(StartReason::Gap { gap_s })
        } else if gap_s <= 0.0 {
            Some(StartReason::StampsWentBack { by_s: -gap_s })
        } else {
            None
        };
        let Some(measured) = &frame.measured else {
            if restart.is_some() {
                self.belief = Belief::default();
                return TrackOutcome::Dropped { gap_s };
            }
            return TrackOutcome::Coasting { gap_s };
        };
        if let Some(reason) = restart {
            return self.start(frame, measured, reason);
        }
        let needed = self.checked.confirm_frames;
        let limit = self.checked.gate;
        let was_confirmed = state.motion.consistent_frames >= needed;
        match step(&self.checked, &mut self.scratch, state, frame, measured) {
            Err(Refused::LostPrecision) => self.start(frame, measured, StartReason::LostPrecision),
            Err(Refused::Contradicts { innovation_squared }) if was_confirmed => {
                self.challenge(frame, measured);
                let rival = self.belief.challenger.as_ref();
                if rival.is_some_and(|rival| rival.motion.consistent_frames >= needed) {
                    self.belief.state = self.belief.challenger.take();
                    return TrackOutcome::Acquired;
                }
                TrackOutcome::Gated {
                    innovation_squared,
                    limit,
                }
            }
            Err(Refused::Contradicts { innovation_squared }) => {
                let reason = StartReason::Inconsistent {
                    innovation_squared,
                    limit,
                };
                self.start(frame, measured, reason)
            }
            Ok(innovation_squared) => {
                let consistent_frames = state.motion.consistent_frames;
                self.belief.challenger = None;
                if was_confirmed {
                    TrackOutcome::Updated { innovation_squared }
                } else if consistent_frames >= needed {
                    TrackOutcome::Acquired
                } else {
                    TrackOutcome::Confirming {
                        consistent_frames,
                        needed,
                    }
                }
            }
        }
    }

    /// Takes a pose that the gate has refused for the track that such poses may make.
    fn challenge(&mut self, frame: &Frame, measured: &Measured) {
        if let Some(rival) = &mut self.belief.challenger {
            let gap_s = seconds(frame.stamp_ns, rival.motion.stamp_ns);
            let is_next = gap_s > 0.0 && gap_s <= self.checked.max_gap_s;
            if is_next && step(&self.checked, &mut self.scratch, rival, frame, measured).is_ok() {
                return;
            }
        }
        self.checked
            .begin(&mut self.belief.challenger, frame, measured);
    }

    /// Returns track or candidate, the noise that drives it, and whether it is confirmed.
    pub(super) fn believed(&self) -> Option<(Track, Noise, bool)> {
        let state = self.belief.state.as_ref()?;
        Some((
            state.track(),
            *self.checked.noise(&state.motion.lag),
            self.confirmed().is_some(),
        ))
    }

    /// Returns a column of the covariance of motion and lasting causes.
    #[cfg(test)]
    pub(super) fn lasting_column(&self, at: usize) -> Option<crate::geometry::Vector12> {
        self.belief.state.as_ref()?.lasting.column(at)
    }

    fn confirmed(&self) -> Option<&State> {
        let state = self.belief.state.as_ref()?;
        (state.motion.consistent_frames >= self.checked.confirm_frames).then_some(state)
    }

    fn start(&mut self, frame: &Frame, measured: &Measured, reason: StartReason) -> TrackOutcome {
        self.checked.begin(&mut self.belief.state, frame, measured);
        self.belief.challenger = None;
        TrackOutcome::Started(reason)
    }

    fn with_floor(&self, covariance: &PoseCovariance) -> PoseCovariance {
        let mut floored = *covariance;
        for axis in 0..3 {
            floored.0[(axis, axis)] += self.checked.position_floor_variance;
            floored.0[(3 + axis, 3 + axis)] += self.checked.attitude_floor_variance;
        }
        floored
    }
}

impl Checked {
    fn noise(&self, lag: &Lag) -> &Noise {
        if lag.is_manoeuvring() {
            &self.manoeuvre_noise
        } else {
            &self.noise
        }
    }

    /// Makes a state the candidate that begins with a frame.
    fn begin(&self, state: &mut Option<State>, frame: &Frame, measured: &Measured) {
        let mut lasting = state
            .take()
            .map_or_else(Lasting::default, |state| state.lasting);
        let noise = measured.noise.0 + lasting.start(&frame.lasting);
        let mut covariance = Matrix12::zeros();
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(&noise);
        for axis in 0..3 {
            covariance[(6 + axis, 6 + axis)] = self.initial_speed_variance;
            covariance[(9 + axis, 9 + axis)] = self.initial_rate_variance;
        }
        let motion = StateMotion {
            stamp_ns: frame.stamp_ns,
            given_causes: Motion {
                b_from_a: measured.camera_from_tanker,
                velocity_in_b: Vector3::zeros(),
                rate_in_b: Vector3::zeros(),
                covariance,
            },
            consistent_frames: 1,
            lag: Lag::default(),
        };
        *state = Some(State { motion, lasting });
    }
}

/// Corrects a track or candidate by a pose after it, and returns the squared innovation. What contradicts it leaves it
/// as it was.
fn step(
    checked: &Checked,
    scratch: &mut Lasting,
    state: &mut State,
    frame: &Frame,
    measured: &Measured,
) -> Result<f64, Refused> {
    let StateMotion {
        stamp_ns,
        given_causes,
        consistent_frames,
        lag,
    } = &state.motion;
    let gap_s = seconds(frame.stamp_ns, *stamp_ns);
    let transition = Transition::new(given_causes, gap_s);
    let mut predicted = advance(given_causes, &transition, checked.noise(lag));
    let difference = Difference::new(&predicted, &measured.camera_from_tanker);
    scratch.clone_from(&state.lasting);
    scratch.predict(gap_s, &transition, &mut predicted.covariance);
    let noise = measured.noise.0 + scratch.see(&frame.lasting, &difference.turn);
    let noise = PoseCovariance(noise);
    let sums = scratch.sums();
    let innovate = |from: &Motion| {
        let covariance = from.pose_covariance();
        Innovation::new(&difference, &covariance, &noise, sums.as_ref())
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
    scratch.correct(&correction);
    std::mem::swap(&mut state.lasting, scratch);
    state.motion = StateMotion {
        stamp_ns: frame.stamp_ns,
        given_causes: correction.motion,
        consistent_frames: consistent_frames.saturating_add(1),
        lag: next_lag,
    };
    Ok(innovation_squared)
}

fn check(
    pose: &Isometry3<f64>,
    noise: &PoseCovariance,
    lasting: &[LastingError],
) -> Result<(), MeasurementError> {
    let position = pose.translation.vector;
    let numbers = position.iter().chain(pose.rotation.coords.iter());
    if !numbers.copied().all(f64::is_finite) {
        return Err(MeasurementError::PoseNotFinite);
    }
    let is_usable = |error: &LastingError| {
        error.shift.iter().all(|number| number.is_finite())
            && error.time_constant_s.is_none_or(|s| s > 0.0)
    };
    if !lasting.iter().all(is_usable) {
        return Err(MeasurementError::InvalidLastingError);
    }
    let is_symmetric = noise.0 == noise.0.transpose();
    // All of the noise may last: then the frame has none of its own.
    let whole = lasting.iter().fold(noise.0, |sum, error| {
        sum + error.shift * error.shift.transpose()
    });
    let is_covariance = |m: &Matrix6<f64>| Factor::new(&rows(&symmetric(m))).is_some();
    let has_no_negative_variance = noise.0.diagonal().iter().all(|variance| *variance >= 0.0);
    if !(is_symmetric && has_no_negative_variance && is_covariance(&whole)) {
        return Err(MeasurementError::InvalidCovariance);
    }
    Ok(())
}
