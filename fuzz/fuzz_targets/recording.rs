//! libFuzzer's program of the target `recording`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("recording", bytes));
