//! libFuzzer's program of the target `calibration_budget`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("calibration_budget", bytes));
