//! libFuzzer's program of the target `solve_line`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("solve_line", bytes));
