//! A table of parameters for tests: one of each kind.

use super::{count, double, frame_id, integer, one_of, optional_text, switch, text};

/// How it measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Fast,
    Careful,
}

crate::words! { Mode: "fast" => Mode::Fast, "careful" => Mode::Careful }

/// All of them.
pub const SAMPLE: &[super::ParameterSpec] = TABLE;

// What a small sensor driver might declare.
crate::declare_parameters! {
    "Measurements" {
        /// how often it measures
        rate_hz: f64 = double(10.0, [0.5, 1000.0]).unit("Hz");
        /// attempts after a failed one,
        /// which is the most that the sensor takes
        retries: i64 = integer(1, [0, 2]);
        /// fewer give no measurement
        min_samples: usize = count(5, [3, 100]);
        /// how it measures
        mode: Mode = one_of();
    }
    "Connection" {
        /// where it is connected
        device: String = text("/dev/ttyS0").fixed();
        /// a file, or none
        calibration: Option<String> = optional_text().fixed();
        /// frame of its measurements
        frame_id: String = frame_id("sensor");
        /// smooth the measurements
        filtered: bool = switch(false);
    }
}
