//! The track: when it begins, what it believes, when it ends.

use nalgebra::Isometry3;

use super::belief::Belief;
use super::follower::Follower;
use super::frame::{Frame, Measured, check};
use super::history::{Entry, History, Place};
use super::lasting::LastingError;
use super::model::{Noise, Transition, predict};
use super::outcome::{PredictError, StartReason, TrackOutcome};
use super::settings::{Checked, CheckedFilterSettings, FilterSettings, FilterSettingsError};
use super::state::{Refused, State, step};
use super::track::{Track, seconds};
use crate::geometry::{Matrix12, Motion, PoseCovariance};

/// Turns poses of single frames into a track. It reads no clock, and allocates only until it has room for the frames of
/// half a second.
///
/// A frame that comes late is taken at its own time, if that is less than 0.5 s behind the last accepted frame and no
/// more than sixty frames are kept since: frames after it are taken again. The track is then the same, bit for bit, as if all frames
/// had come in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter<F: Follower = ()> {
    settings: FilterSettings,
    checked: Checked,
    belief: Belief<F>,
    history: History<F>,
}

impl<F: Follower> From<CheckedFilterSettings> for Filter<F> {
    /// Returns a filter without a track.
    fn from(settings: CheckedFilterSettings) -> Self {
        Self {
            checked: settings.checked,
            settings: *settings.settings(),
            belief: Belief::default(),
            history: History::default(),
        }
    }
}

impl Filter {
    /// Returns a filter without a track, whose error nothing follows.
    ///
    /// # Errors
    /// [`FilterSettingsError`] names the first setting out of range.
    pub fn new(settings: FilterSettings) -> Result<Self, FilterSettingsError> {
        Ok(Self::from(settings.checked()?))
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
    /// As for [`Self::update_followed`].
    pub fn update_with_lasting(
        &mut self,
        stamp_ns: i64,
        camera_from_tanker: &Isometry3<f64>,
        noise: &PoseCovariance,
        lasting: &[LastingError],
    ) -> TrackOutcome {
        self.update_followed(stamp_ns, camera_from_tanker, noise, lasting, ())
    }
}

impl<F: Follower> Filter<F> {
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

    /// Takes the pose of one frame, whose error has parts in common with those of other frames, and what the follower of
    /// the error needs of it.
    ///
    /// # Inputs
    /// * `stamp_ns`: when the image was taken.
    /// * `camera_from_tanker`: a trusted estimate.
    /// * `noise`: covariance of the part of the error that is this frame's own.
    /// * `lasting`: the parts that other frames share. The first 58 of a track are carried one by one, others together
    ///   as constant errors of the pose: those with a time constant and the largest come first.
    /// * `input`: for what follows the error.
    pub fn update_followed(
        &mut self,
        stamp_ns: i64,
        camera_from_tanker: &Isometry3<f64>,
        noise: &PoseCovariance,
        lasting: &[LastingError],
        input: F::Input,
    ) -> TrackOutcome {
        if let Err(error) = check(camera_from_tanker, noise, lasting) {
            return TrackOutcome::Invalid(error);
        }
        let measured = Measured {
            camera_from_tanker: *camera_from_tanker,
            noise: self.with_floor(noise),
        };
        self.take(stamp_ns, Some(&measured), lasting, input)
    }

    /// Returns what follows the track's error, at the last accepted frame, and the transition of errors from there to a
    /// stamp; `None` where [`Self::predict`] gives nothing.
    #[must_use]
    pub fn follower(&self, stamp_ns: i64) -> Option<(&F, Matrix12)> {
        let state = self.confirmed()?;
        let gap_s = seconds(stamp_ns, state.motion.stamp_ns);
        let is_within = (0.0..=self.checked.max_gap_s).contains(&gap_s);
        let motion = &state.motion.given_causes;
        is_within.then(|| (&state.follower, Transition::new(motion, gap_s).matrix()))
    }

    /// Takes the stamp of a frame that gave no pose, and returns whether the track outlives it.
    pub fn miss(&mut self, stamp_ns: i64) -> TrackOutcome {
        self.take(stamp_ns, None, &[], F::Input::default())
    }

    /// Puts a frame among the others, by its stamp.
    fn take(
        &mut self,
        stamp_ns: i64,
        measured: Option<&Measured>,
        lasting: &[LastingError],
        input: F::Input,
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
            entry.frame.input = input;
        }
        // Out, so that its frames can be read while the belief changes.
        let mut history = std::mem::take(&mut self.history);
        if let Some(next) = history.entry(at + 1) {
            self.belief.clone_from(&next.before);
        }
        let mut outcome = None;
        for at in at..history.len() {
            if let Some(Entry { frame, before }) = history.entry(at) {
                // Swapped, not copied: what is believed after it is made anew, in the old memory.
                std::mem::swap(before, &mut self.belief);
                let of_frame = self.follow(before, frame);
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

    /// Goes on by one frame, in the order of stamps: makes the belief after it.
    fn follow(&mut self, before: &Belief<F>, frame: &Frame<F::Input>) -> TrackOutcome {
        let stamp_ns = frame.stamp_ns;
        let Some(state) = &before.state else {
            if let Some(measured) = &frame.measured {
                return self.start(frame, measured, StartReason::First);
            }
            self.belief.clone_from(before);
            return TrackOutcome::Idle;
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
            self.belief.clone_from(before);
            return TrackOutcome::Coasting { gap_s };
        };
        if let Some(reason) = restart {
            return self.start(frame, measured, reason);
        }
        let needed = self.checked.confirm_frames;
        let limit = self.checked.gate;
        let was_confirmed = state.motion.consistent_frames >= needed;
        match step(
            &self.checked,
            state,
            &mut self.belief.state,
            frame,
            measured,
        ) {
            Err(Refused::LostPrecision) => self.start(frame, measured, StartReason::LostPrecision),
            Err(Refused::Contradicts { innovation_squared }) if was_confirmed => {
                self.challenge(before.challenger.as_ref(), frame, measured);
                let rival = self.belief.challenger.as_ref();
                if rival.is_some_and(|rival| rival.motion.consistent_frames >= needed) {
                    self.belief.state = self.belief.challenger.take();
                    return TrackOutcome::Acquired;
                }
                self.belief.state.clone_from(&before.state);
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
                let consistent_frames = state.motion.consistent_frames.saturating_add(1);
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
    fn challenge(
        &mut self,
        rival: Option<&State<F>>,
        frame: &Frame<F::Input>,
        measured: &Measured,
    ) {
        let challenger = &mut self.belief.challenger;
        if let Some(rival) = rival {
            let gap_s = seconds(frame.stamp_ns, rival.motion.stamp_ns);
            let is_next = gap_s > 0.0 && gap_s <= self.checked.max_gap_s;
            if is_next && step(&self.checked, rival, challenger, frame, measured).is_ok() {
                return;
            }
        }
        self.checked.begin(challenger, frame, measured);
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

    fn confirmed(&self) -> Option<&State<F>> {
        let state = self.belief.state.as_ref()?;
        (state.motion.consistent_frames >= self.checked.confirm_frames).then_some(state)
    }

    fn start(
        &mut self,
        frame: &Frame<F::Input>,
        measured: &Measured,
        reason: StartReason,
    ) -> TrackOutcome {
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
