//! A table of parameters for tests: one of each kind.

use super::{Kind, ParameterSpec};

/// What a small sensor driver might declare.
pub const SAMPLE: &[ParameterSpec] = &[
    ParameterSpec {
        name: "rate_hz",
        kind: Kind::Double {
            default: 10.0,
            min: 0.5,
            max: 1000.0,
        },
        read_only: false,
        description: "Hz, how often it measures",
    },
    ParameterSpec {
        name: "retries",
        kind: Kind::Integer {
            default: 1,
            min: 0,
            max: 2,
        },
        read_only: false,
        description: "attempts after a failed one",
    },
    ParameterSpec {
        name: "min_samples",
        kind: Kind::Integer {
            default: 5,
            min: 3,
            max: 100,
        },
        read_only: false,
        description: "fewer samples than this give no measurement",
    },
    ParameterSpec {
        name: "mode",
        kind: Kind::Choice {
            default: "fast",
            allowed: &["fast", "careful"],
        },
        read_only: false,
        description: "how it measures",
    },
    ParameterSpec {
        name: "device",
        kind: Kind::Text {
            default: "/dev/ttyS0",
        },
        read_only: true,
        description: "where it is connected",
    },
    ParameterSpec {
        name: "frame_id",
        kind: Kind::FrameId { default: "sensor" },
        read_only: false,
        description: "frame of its measurements",
    },
    ParameterSpec {
        name: "filtered",
        kind: Kind::Bool { default: false },
        read_only: false,
        description: "smooth the measurements",
    },
];
