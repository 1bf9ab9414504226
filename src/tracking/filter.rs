//! The track: when it begins, what it believes, when it ends.

use nalgebra::{Isometry3, Vector3};

use super::lag::{Lag, MEMORY_FRAMES};
use super::model::{Innovation, Noise, add_noise, predict};
use super::settings::Checked;
use super::symmetric6::{Factor, rows};
use super::{
    CheckedFilterSettings, FilterSettings, FilterSettingsError, MeasurementError, PredictError,
    StartReason, TrackOutcome,
};
use crate::geometry::{Matrix12, Motion, PoseCovariance};

/// The motion of the tanker in the camera at the time of one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// Time of the image, ns.
    pub stamp_ns: i64,
    /// `camera_from_tanker` with velocity, rate and covariance: `b` is the camera, `a` the tanker.
    pub motion: Motion,
}

/// A track, or a candidate for one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct State {
    track: Track,
    consistent_frames: u32,
    /// The latest stamp of any frame, accepted or not.
    seen_ns: i64,
    lag: Lag,
}

/// Where a stamp stands to the last accepted one.
enum Place {
    /// After it, within the gap.
    Next { gap_s: f64 },
    /// The frame says nothing new.
    Unusable(TrackOutcome),
    /// On another time line: a candidate begins there.
    Elsewhere(StartReason),
}

/// Turns poses of single frames into a track. It allocates nothing and reads no clock.
///
/// A frame that comes later than one with a younger stamp is not used: nothing is computed twice.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    settings: FilterSettings,
    checked: Checked,
    state: Option<State>,
    /// What the frames say that the gate refuses, one after the other: a track of their own, if they agree.
    challenger: Option<State>,
}

/// Why a pose does not correct a track or candidate.
enum Refused {
    Contradicts { innovation_squared: f64 },
    LostPrecision,
}

/// A pose with its time, the floor added to its covariance.
struct Measured<'a> {
    stamp_ns: i64,
    camera_from_tanker: &'a Isometry3<f64>,
    covariance: PoseCovariance,
}

impl From<CheckedFilterSettings> for Filter {
    /// Returns a filter without a track.
    fn from(settings: CheckedFilterSettings) -> Self {
        Self {
            checked: settings.checked,
            settings: *settings.settings(),
            state: None,
            challenger: None,
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

    /// Takes other settings from the next frame on; track and candidate stay.
    pub fn set_settings(&mut self, settings: CheckedFilterSettings) {
        self.checked = settings.checked;
        self.settings = *settings.settings();
    }

    /// Forgets track and candidate; the next pose is the first.
    pub fn reset(&mut self) {
        self.state = None;
        self.challenger = None;
    }

    /// Returns the track at the last accepted frame; `None` while it is not confirmed.
    #[must_use]
    pub fn track(&self) -> Option<&Track> {
        self.confirmed().map(|state| &state.track)
    }

    /// Returns whether the last frames moved more than the quiet noise explains, so that the larger one holds.
    #[must_use]
    pub fn is_manoeuvring(&self) -> bool {
        self.confirmed()
            .is_some_and(|state| state.lag.is_manoeuvring())
    }

    /// Returns the largest squared innovation that the gate accepts.
    #[must_use]
    pub fn gate_limit(&self) -> f64 {
        self.checked.gate
    }

    /// Returns the motion expected at a stamp, with its covariance: a start for the next estimate.
    ///
    /// # Errors
    /// [`PredictError`]: no track, a stamp before it, or one more than `max_gap_s` after it.
    pub fn predict(&self, stamp_ns: i64) -> Result<Motion, PredictError> {
        let state = self.confirmed().ok_or(PredictError::NoTrack)?;
        let gap_s = seconds(stamp_ns, state.track.stamp_ns);
        if gap_s < 0.0 {
            return Err(PredictError::BeforeTrack { by_s: -gap_s });
        }
        let limit_s = self.checked.max_gap_s;
        if gap_s > limit_s {
            return Err(PredictError::BeyondGap { gap_s, limit_s });
        }
        Ok(predict(&state.track.motion, gap_s, self.noise(&state.lag)))
    }

    /// Returns how far a pose is from what the track expects at its stamp: the squared innovation over
    /// its covariance, chi-squared with 6 degrees of freedom, to be held against [`Self::gate_limit`].
    ///
    /// Of two poses that fit an image alike, the one that the motion so far contradicts is found by this.
    /// It changes nothing.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn innovation_squared(
        &self,
        stamp_ns: i64,
        camera_from_tanker: &Isometry3<f64>,
        covariance: &PoseCovariance,
    ) -> Result<f64, PredictError> {
        let predicted = self.predict(stamp_ns)?;
        let noise = self.with_floor(covariance);
        Ok(Innovation::new(&predicted, camera_from_tanker, &noise)
            .map_or(f64::INFINITY, |innovation| innovation.squared))
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
        if let Err(error) = check(camera_from_tanker, covariance) {
            return TrackOutcome::Invalid(error);
        }
        let measured = Measured {
            stamp_ns,
            camera_from_tanker,
            covariance: self.with_floor(covariance),
        };
        let Some(mut state) = self.state else {
            return self.start(&measured, StartReason::First);
        };
        let gap_s = match self.place(&state, stamp_ns) {
            Place::Next { gap_s } => gap_s,
            Place::Unusable(outcome) => return outcome,
            Place::Elsewhere(reason) => return self.start(&measured, reason),
        };
        state.seen_ns = state.seen_ns.max(stamp_ns);
        let is_confirmed = state.consistent_frames >= self.checked.confirm_frames;
        let limit = self.checked.gate;
        match self.step(&state, gap_s, &measured) {
            Err(Refused::LostPrecision) => self.start(&measured, StartReason::LostPrecision),
            Err(Refused::Contradicts { innovation_squared }) if is_confirmed => {
                self.state = Some(state);
                self.challenge(&measured);
                if self
                    .challenger
                    .is_some_and(|rival| self.is_confirmed(&rival))
                {
                    self.state = self.challenger.take();
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
                self.start(&measured, reason)
            }
            Ok((state, innovation_squared)) => {
                self.state = Some(state);
                self.challenger = None;
                let needed = self.checked.confirm_frames;
                if is_confirmed {
                    TrackOutcome::Updated { innovation_squared }
                } else if self.is_confirmed(&state) {
                    TrackOutcome::Acquired
                } else {
                    TrackOutcome::Confirming {
                        consistent_frames: state.consistent_frames,
                        needed,
                    }
                }
            }
        }
    }

    /// Returns a track or candidate corrected by a pose `gap_s` after its last frame, and the squared innovation.
    fn step(
        &self,
        state: &State,
        gap_s: f64,
        measured: &Measured,
    ) -> Result<(State, f64), Refused> {
        let mut predicted = predict(&state.track.motion, gap_s, self.noise(&state.lag));
        let innovate = |from: &Motion| {
            Innovation::new(from, measured.camera_from_tanker, &measured.covariance)
        };
        let mut innovation = innovate(&predicted).ok_or(Refused::LostPrecision)?;
        let innovation_squared = innovation.squared;
        if innovation_squared > self.checked.gate {
            return Err(Refused::Contradicts { innovation_squared });
        }
        let lag = state
            .lag
            .with(&innovation.whitened, gap_s, self.checked.lag_limit);
        if lag.is_manoeuvring() && !state.lag.is_manoeuvring() {
            // It has lagged since it began to lean, so the larger noise is owed for that time too.
            add_noise(
                &mut predicted,
                MEMORY_FRAMES * gap_s,
                &self.checked.manoeuvre_noise,
            );
            innovation = innovate(&predicted).ok_or(Refused::LostPrecision)?;
        }
        let motion = innovation
            .corrected(&predicted)
            .ok_or(Refused::LostPrecision)?;
        let corrected = State {
            track: Track {
                stamp_ns: measured.stamp_ns,
                motion,
            },
            consistent_frames: state.consistent_frames.saturating_add(1),
            lag,
            ..*state
        };
        Ok((corrected, innovation_squared))
    }

    /// Takes a pose that the gate has refused for the track that such poses may make.
    fn challenge(&mut self, measured: &Measured) {
        let going_on = self.challenger.and_then(|rival| {
            let Place::Next { gap_s } = self.place(&rival, measured.stamp_ns) else {
                return None;
            };
            let (state, _) = self.step(&rival, gap_s, measured).ok()?;
            Some(State {
                seen_ns: measured.stamp_ns,
                ..state
            })
        });
        self.challenger = Some(going_on.unwrap_or_else(|| self.candidate(measured)));
    }

    fn place(&self, state: &State, stamp_ns: i64) -> Place {
        if stamp_ns == state.seen_ns || stamp_ns == state.track.stamp_ns {
            return Place::Unusable(TrackOutcome::Duplicate { stamp_ns });
        }
        let gap_s = seconds(stamp_ns, state.track.stamp_ns);
        if gap_s > self.checked.max_gap_s {
            Place::Elsewhere(StartReason::Gap { gap_s })
        } else if gap_s < -self.checked.max_gap_s {
            Place::Elsewhere(StartReason::StampsWentBack { by_s: -gap_s })
        } else if gap_s < 0.0 {
            Place::Unusable(TrackOutcome::Late { late_by_s: -gap_s })
        } else {
            Place::Next { gap_s }
        }
    }

    /// Tells the filter of a frame that gave no pose, and returns whether the track outlives it.
    pub fn miss(&mut self, stamp_ns: i64) -> TrackOutcome {
        let Some(state) = self.state else {
            return TrackOutcome::Idle;
        };
        let outcome = match self.place(&state, stamp_ns) {
            Place::Unusable(outcome) => return outcome,
            Place::Elsewhere(_) => {
                self.reset();
                return TrackOutcome::Dropped {
                    gap_s: seconds(stamp_ns, state.track.stamp_ns),
                };
            }
            Place::Next { gap_s } => TrackOutcome::Coasting { gap_s },
        };
        self.state = Some(State {
            seen_ns: state.seen_ns.max(stamp_ns),
            ..state
        });
        outcome
    }

    /// Returns track or candidate, the noise that drives it, and whether it is confirmed.
    pub(super) fn believed(&self) -> Option<(Track, Noise, bool)> {
        let state = self.state.as_ref()?;
        Some((
            state.track,
            *self.noise(&state.lag),
            self.is_confirmed(state),
        ))
    }

    fn confirmed(&self) -> Option<&State> {
        self.state.as_ref().filter(|state| self.is_confirmed(state))
    }

    fn is_confirmed(&self, state: &State) -> bool {
        state.consistent_frames >= self.checked.confirm_frames
    }

    fn start(&mut self, measured: &Measured, reason: StartReason) -> TrackOutcome {
        self.state = Some(self.candidate(measured));
        self.challenger = None;
        TrackOutcome::Started(reason)
    }

    /// Returns the candidate that begins with this frame.
    fn candidate(&self, measured: &Measured) -> State {
        let mut full = Matrix12::zeros();
        full.fixed_view_mut::<6, 6>(0, 0)
            .copy_from(&measured.covariance.0);
        for axis in 0..3 {
            full[(6 + axis, 6 + axis)] = self.checked.initial_speed_variance;
            full[(9 + axis, 9 + axis)] = self.checked.initial_rate_variance;
        }
        State {
            track: Track {
                stamp_ns: measured.stamp_ns,
                motion: Motion {
                    b_from_a: *measured.camera_from_tanker,
                    velocity_in_b: Vector3::zeros(),
                    rate_in_b: Vector3::zeros(),
                    covariance: full,
                },
            },
            consistent_frames: 1,
            seen_ns: measured.stamp_ns,
            lag: Lag::default(),
        }
    }

    fn noise(&self, lag: &Lag) -> &Noise {
        if lag.is_manoeuvring() {
            &self.checked.manoeuvre_noise
        } else {
            &self.checked.noise
        }
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

fn check(pose: &Isometry3<f64>, covariance: &PoseCovariance) -> Result<(), MeasurementError> {
    let position = pose.translation.vector;
    let numbers = position.iter().chain(pose.rotation.coords.iter());
    if !numbers.copied().all(f64::is_finite) {
        return Err(MeasurementError::PoseNotFinite);
    }
    let is_symmetric = covariance.0 == covariance.0.transpose();
    if !(is_symmetric && Factor::new(&rows(&covariance.0)).is_some()) {
        return Err(MeasurementError::InvalidCovariance);
    }
    Ok(())
}

/// Returns `later − earlier`; whole nanoseconds, so that no clock's epoch costs precision.
pub(super) fn seconds(later_ns: i64, earlier_ns: i64) -> f64 {
    // In 128 bits the difference of any two stamps exists.
    let nanoseconds = i128::from(later_ns) - i128::from(earlier_ns);
    // Divided, not multiplied: ten seconds are then exactly ten.
    nanoseconds as f64 / 1e9
}
