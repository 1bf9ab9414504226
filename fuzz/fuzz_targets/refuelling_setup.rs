//! libFuzzer's program of the target `refuelling_setup`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tanker_pose_fuzz::run("refuelling_setup", bytes));
