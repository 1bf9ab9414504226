//! Output `integrity`, with counts for diagnostics.

use std::time::Instant;

use super::diagnostics::Tally;
use super::output::Output;
use crate::convert;
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
        }
    }

    /// Publishes the protection levels of a frame; returns whether they are available and keep their limits.
    pub(super) fn on_outcome(
        &mut self,
        header: &Header,
        outcome: &FrameOutcome,
        pipeline: &Pipeline,
        tally: &mut Tally,
        now: Instant,
    ) -> bool {
        let (Some(monitor), Some(levels)) = (pipeline.integrity(), &outcome.integrity) else {
            return false;
        };
        let mode = |index| pipeline.mode_name(index);
        let message = convert::integrity(header.clone(), monitor, levels, mode);
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
        self.output.publish(message, tally);
        state == IntegrityState::Available
    }

    /// Forgets what was counted.
    pub(super) fn reset(&mut self) {
        self.counts = [0; IntegrityState::ALL.len()];
        self.frames = 0;
        self.reason = None;
        self.log_gate = SaidOnce::default();
    }

    /// Returns the counts, and the last reason since the last report.
    pub(super) fn diagnostics(&mut self, node: &str) -> DiagnosticStatus {
        let reason = self.reason.take();
        let frames = std::mem::take(&mut self.frames);
        let values = IntegrityState::ALL.into_iter().zip(self.counts);
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
                .map(|(state, count)| KeyValue {
                    key: state.name().to_ascii_lowercase(),
                    value: count.to_string(),
                })
                .collect(),
        }
    }
}
