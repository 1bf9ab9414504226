//! libFuzzer's program of the target `marker_map`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("marker_map", bytes));
