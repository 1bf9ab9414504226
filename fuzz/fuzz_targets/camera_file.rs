//! libFuzzer's program of the target `camera_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("camera_file", bytes));
