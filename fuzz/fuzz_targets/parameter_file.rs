//! libFuzzer's program of the target `parameter_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("parameter_file", bytes));
