//! What the simulation prints: a bar on a terminal, a line a second elsewhere, JSON for programs.

use std::io::{IsTerminal, Write};

use indicatif::ProgressBar;
use nalgebra::Isometry3;
use serde_json::{Value, json};
use tanker_pose::pipeline::Detection;
use tanker_pose::simulation::SimulatedFrame;

use super::source::Sent;
use crate::terminal::{progress_bar, say};

/// Where the frames are reported to.
pub struct Report {
    json: bool,
    bar: ProgressBar,
    /// Frames from one line to the next; `None` where a bar is seen instead.
    line_every: Option<u64>,
    length: Option<u32>,
    frames: u64,
    dropped: u64,
}

impl Report {
    /// Returns a report on `length` frames, or on endlessly many.
    pub fn new(json: bool, length: Option<u32>, rate_hz: f64) -> Self {
        let bar = if json {
            ProgressBar::hidden()
        } else {
            progress_bar(length.map_or(u64::MAX, u64::from))
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between one frame a line and the highest rate, 1000 Hz"
        )]
        let frames_a_second = rate_hz.round().max(1.0) as u64;
        Self {
            json,
            bar,
            line_every: (!std::io::stderr().is_terminal()).then_some(frames_a_second),
            length,
            frames: 0,
            dropped: 0,
        }
    }

    /// Prints a line for people.
    pub fn say(&self, line: &str) {
        if !self.json {
            say(&self.bar, line);
        }
    }

    /// Records a published frame, `gross_error_id` being that of a detection that was moved.
    pub fn frame(
        &mut self,
        number: u64,
        frame: &SimulatedFrame,
        gross_error_id: Option<u32>,
        sent: &Sent,
    ) {
        self.frames += 1;
        self.dropped += u64::from(sent.dropped);
        if self.json {
            let line = json_line(number, frame, gross_error_id, sent);
            // A reader that has seen enough is no fault.
            let mut out = std::io::stdout().lock();
            let _ = writeln!(out, "{line}").and_then(|()| out.flush());
            return;
        }
        let state = format!(
            "{:6.2} m ahead, {} markers in the image",
            frame.truth_camera_from_tanker.translation.z,
            frame.detections.len()
        );
        if self
            .line_every
            .is_some_and(|every| number.is_multiple_of(every))
        {
            let length = self
                .length
                .map_or(String::new(), |length| format!("/{length}"));
            self.say(&format!("frame {number}{length}: {state}"));
        }
        if let Some(id) = gross_error_id {
            self.say(&format!("frame {number}: marker {id} moved on purpose"));
        }
        self.bar.set_message(state);
        self.bar.inc(1);
    }

    /// Prints the result.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
        let dropped = match self.dropped {
            0 => String::new(),
            n => format!("; {n} messages dropped, because a reliable subscriber does not keep up"),
        };
        self.say(&format!("{} frames published{dropped}", self.frames));
    }
}

fn json_line(
    number: u64,
    frame: &SimulatedFrame,
    gross_error_id: Option<u32>,
    sent: &Sent,
) -> Value {
    let truth: &Isometry3<f64> = &frame.truth_camera_from_tanker;
    let (t, q) = (&truth.translation, truth.rotation.quaternion());
    let point = |seen: &Detection| json!({"id": seen.id, "u": seen.u_px, "v": seen.v_px, "sigma": seen.sigma_px});
    json!({
        "frame": number,
        "stamp": {"sec": sent.stamp.sec, "nanosec": sent.stamp.nanosec},
        "time_s": frame.time_s,
        "truth": {"translation": [t.x, t.y, t.z], "quaternion": [q.i, q.j, q.k, q.w]},
        "points": frame.detections.iter().map(point).collect::<Vec<_>>(),
        "gross_error_id": gross_error_id,
        "dropped": sent.dropped,
    })
}
