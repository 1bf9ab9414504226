//! libFuzzer's program of the target `replay`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("replay", bytes));
