//! Output `integrity`, with counts for diagnostics.

use std::time::Instant;

use super::consumers::Protection;
use super::diagnostics::Tally;
use super::output::Output;
use crate::convert;
use crate::messages::{DiagnosticStatus, Header, Integrity, KeyValue};
use crate::pipeline::{FrameOutcome, IntegrityState, Pipeline};
use ros2_node::once::SaidOnce;

/// The output, and what became of its frames since the start.
pub struct IntegrityOutput {
    output: Output<Integrity>,
    of_frame: States,
    of_track: States,
    /// Since the last report.
    frames: u64,
    /// Since the last report.
    reason: Option<String>,
}

/// How often each state was met, and what of it was logged.
#[derive(Default)]
struct States {
    counts: [u64; IntegrityState::ALL.len()],
    log_gate: SaidOnce<IntegrityState>,
}

impl States {
    /// Takes a state; logs its beginning and its end. Of one without anything to protect the status says why.
    fn take(&mut self, state: IntegrityState, of: &str, message: &str, now: Instant) {
        self.counts[usize::from(state.number())] += 1;
        match state {
            IntegrityState::Available => {
                if let Some(count) = self.log_gate.good() {
                    log::info!("the {of} is protected again after {count} frames");
                }
            }
            IntegrityState::NoPose | IntegrityState::None => {}
            _ => {
                if self.log_gate.fault(state, now) {
                    log::warn!("the {of} is not protected: {message}");
                }
            }
        }
    }
}

impl IntegrityOutput {
    /// Returns the output without frames.
    #[must_use]
    pub fn new(output: Output<Integrity>) -> Self {
        Self {
            output,
            of_frame: States::default(),
            of_track: States::default(),
            frames: 0,
            reason: None,
        }
    }

    /// Publishes the protection levels of a frame and of the track; returns which are available and keep their limits.
    pub(super) fn on_outcome(
        &mut self,
        header: &Header,
        outcome: &FrameOutcome,
        pipeline: &Pipeline,
        tally: &mut Tally,
        now: Instant,
    ) -> Protection {
        let (Some(monitor), Some(levels), Some(of_track)) = (
            pipeline.integrity(),
            &outcome.integrity,
            &outcome.track_integrity,
        ) else {
            return Protection::default();
        };
        let mode = |index| pipeline.mode_name(index);
        let message = convert::integrity(header.clone(), monitor, levels, of_track, mode);
        let (state, track_state) = (IntegrityState::from(levels), IntegrityState::from(of_track));
        self.frames += 1;
        self.of_frame.take(state, "pose", &message.message, now);
        self.of_track
            .take(track_state, "track", &message.track_message, now);
        let is_wanting = |state| !matches!(state, IntegrityState::Available | IntegrityState::None);
        if is_wanting(state) {
            self.reason = Some(message.message.clone());
        } else if is_wanting(track_state) && self.reason.is_none() {
            self.reason = Some(format!("the track: {}", message.track_message));
        }
        self.output.publish(message, tally);
        Protection {
            of_frame: state == IntegrityState::Available,
            of_track: track_state == IntegrityState::Available,
        }
    }

    /// Forgets what was counted.
    pub(super) fn reset(&mut self) {
        self.of_frame = States::default();
        self.of_track = States::default();
        self.frames = 0;
        self.reason = None;
    }

    /// Returns the counts, and the last reason since the last report.
    pub(super) fn diagnostics(&mut self, node: &str) -> DiagnosticStatus {
        let reason = self.reason.take();
        let frames = std::mem::take(&mut self.frames);
        let of_frames = IntegrityState::ALL.into_iter().zip(self.of_frame.counts);
        let of_frames = of_frames.filter(|(state, _)| *state != IntegrityState::None);
        let of_track = IntegrityState::ALL.into_iter().zip(self.of_track.counts);
        let name = |state: IntegrityState| state.name().to_ascii_lowercase();
        let values = of_frames
            .map(|(state, count)| (name(state), count))
            .chain(of_track.map(|(state, count)| (format!("track_{}", name(state)), count)));
        DiagnosticStatus {
            level: if reason.is_some() {
                DiagnosticStatus::WARN
            } else {
                DiagnosticStatus::OK
            },
            name: format!("{node}: integrity"),
            message: match reason {
                Some(reason) => format!("not protected: {reason}"),
                None if frames == 0 => "no frames".to_owned(),
                None => "protection levels are available".to_owned(),
            },
            hardware_id: String::new(),
            values: values
                .map(|(key, count)| KeyValue {
                    key,
                    value: count.to_string(),
                })
                .collect(),
        }
    }
}
