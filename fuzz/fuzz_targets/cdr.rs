//! libFuzzer's program of the target `cdr`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("cdr", bytes));
