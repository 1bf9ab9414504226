//! A table of parameters for tests: one of each kind.

use super::ParameterSpec;

/// What a small sensor driver might declare.
pub const SAMPLE: &[ParameterSpec] = &[
    ParameterSpec::double("rate_hz", 10.0, [0.5, 1000.0], "Hz, how often it measures"),
    ParameterSpec::integer("retries", 1, [0, 2], "attempts after a failed one"),
    ParameterSpec::integer("min_samples", 5, [3, 100], "fewer give no measurement"),
    ParameterSpec::choice("mode", "fast", &["fast", "careful"], "how it measures"),
    ParameterSpec::text("device", "/dev/ttyS0", "where it is connected").read_only(),
    ParameterSpec::frame_id("frame_id", "sensor", "frame of its measurements"),
    ParameterSpec::bool("filtered", false, "smooth the measurements"),
];
