//! Output `integrity`, with counts for diagnostics.

use std::time::Instant;

use super::consumers::Protection;
use super::diagnostics::Tally;
use super::output::Output;
use crate::convert;
use crate::integrity::{FrameIntegrity, Unavailable};
use crate::messages::{DiagnosticStatus, Header, Integrity, KeyValue};
use crate::pipeline::{FrameOutcome, IntegrityState, Pipeline};
use ros2_node::once::SaidOnce;

/// The output, and what became of its frames since the start.
pub struct IntegrityOutput {
    output: Output<Integrity>,
    counts: [u64; IntegrityState::ALL.len()],
    /// Since the last report.
    frames: u64,
    /// Since the last report.
    reason: Option<String>,
    log_gate: SaidOnce<IntegrityState>,
    track_counts: [u64; IntegrityState::ALL.len()],
    track_log_gate: SaidOnce<IntegrityState>,
}

impl IntegrityOutput {
    /// Returns the output without frames.
    #[must_use]
    pub fn new(output: Output<Integrity>) -> Self {
        Self {
            output,
            counts: [0; IntegrityState::ALL.len()],
            frames: 0,
            reason: None,
            log_gate: SaidOnce::default(),
            track_counts: [0; IntegrityState::ALL.len()],
            track_log_gate: SaidOnce::default(),
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
        let state = IntegrityState::from(levels);
        self.counts[usize::from(state.number())] += 1;
        self.frames += 1;
        if state == IntegrityState::Available {
            if let Some(count) = self.log_gate.good() {
                log::info!("protection levels are available again after {count} frames");
            }
        } else {
            self.reason = Some(message.message.clone());
            // A frame without a pose is reported by the outcome of its frame.
            if state != IntegrityState::NoPose && self.log_gate.fault(state, now) {
                log::warn!("the pose is not protected: {}", message.message);
            }
        }
        let track_state = self.on_track(&message.track_message, of_track, now);
        self.output.publish(message, tally);
        Protection {
            of_frame: state == IntegrityState::Available,
            of_track: track_state == IntegrityState::Available,
        }
    }

    fn on_track(
        &mut self,
        message: &str,
        levels: &Result<FrameIntegrity, Unavailable>,
        now: Instant,
    ) -> IntegrityState {
        let state = IntegrityState::from(levels);
        self.track_counts[usize::from(state.number())] += 1;
        match state {
            IntegrityState::Available => {
                if let Some(count) = self.track_log_gate.good() {
                    log::info!("the track is protected again after {count} frames");
                }
            }
            // There is nothing to protect: the status says why.
            IntegrityState::None => {}
            _ => {
                if self.reason.is_none() {
                    self.reason = Some(format!("the track: {message}"));
                }
                if self.track_log_gate.fault(state, now) {
                    log::warn!("the track is not protected: {message}");
                }
            }
        }
        state
    }

    /// Forgets what was counted.
    pub(super) fn reset(&mut self) {
        self.counts = [0; IntegrityState::ALL.len()];
        self.frames = 0;
        self.reason = None;
        self.log_gate = SaidOnce::default();
        self.track_counts = [0; IntegrityState::ALL.len()];
        self.track_log_gate = SaidOnce::default();
    }

    /// Returns the counts, and the last reason since the last report.
    pub(super) fn diagnostics(&mut self, node: &str) -> DiagnosticStatus {
        let reason = self.reason.take();
        let frames = std::mem::take(&mut self.frames);
        let of_frames = IntegrityState::ALL.into_iter().zip(self.counts);
        let of_frames = of_frames.filter(|(state, _)| *state != IntegrityState::None);
        let of_track = IntegrityState::ALL.into_iter().zip(self.track_counts);
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
