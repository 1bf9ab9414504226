//! The estimator for C: plain structs in, plain structs out.
//!
//! ```text
//! lib             the functions of the header: the only unsafe code, for the pointers of C
//! types           the plain structs, and how they become checked values
//! estimator       set-up, and one frame, in safe code
//! ```
//!
//! After set-up a frame allocates nothing. No panic leaves this library: it becomes the status `INTERNAL`.

mod estimator;
mod types;

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

pub use estimator::{CreateError, Estimator, MOST_DETECTIONS};
pub use types::{
    Camera, Detection, INITIALISATION_DLT, INITIALISATION_GLOBAL, INITIALISATION_NOMINAL,
    INITIALISATION_PREVIOUS, LENS_EQUIDISTANT, LENS_NONE, LENS_PLUMB_BOB, LENS_RATIONAL_POLYNOMIAL,
    MOST_COEFFICIENTS, Marker, OUTCOME_OK, Options, Pose, Status,
};

/// Runs what may not panic, and says so if it does.
fn guarded(work: impl FnOnce() -> Status) -> Status {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(Status::Internal)
}

/// Returns the elements that a pointer and a length of C name; `None` for a null pointer with a length above 0.
///
/// # Safety
/// `data` is null, or points to `count` initialised elements that nothing changes while the result is in use.
unsafe fn elements<'a, T>(data: *const T, count: usize) -> Option<&'a [T]> {
    if count == 0 {
        return Some(&[]);
    }
    if data.is_null() || !data.is_aligned() || count > isize::MAX as usize / size_of::<T>().max(1) {
        return None;
    }
    // SAFETY: not null, aligned, not too long; initialised and unchanged by the caller's promise.
    Some(unsafe { std::slice::from_raw_parts(data, count) })
}

/// Returns what a pointer of C points to; `None` if it is null or not aligned.
///
/// # Safety
/// `data` is null, or points to an initialised value that nothing changes while the result is in use.
unsafe fn element<'a, T>(data: *const T) -> Option<&'a T> {
    if !data.is_aligned() {
        return None;
    }
    // SAFETY: null or aligned; initialised and unchanged by the caller's promise.
    unsafe { data.as_ref() }
}

/// Returns the default options: those of the node.
#[unsafe(no_mangle)]
pub extern "C" fn tanker_pose_default_options() -> Options {
    Options::default()
}

/// Returns the name of an outcome, as `tanker_pose/msg/EstimatorStatus` has it; "UNKNOWN" for other numbers.
#[unsafe(no_mangle)]
pub extern "C" fn tanker_pose_outcome_name(outcome: u32) -> *const c_char {
    name(outcome).as_ptr()
}

const fn name(outcome: u32) -> &'static CStr {
    match outcome {
        0 => c"OK",
        1 => c"NO_CAMERA_INFO",
        2 => c"INVALID_CAMERA_INFO",
        3 => c"FRAME_MISMATCH",
        4 => c"ZERO_STAMP",
        5 => c"UNKNOWN_ID",
        6 => c"DUPLICATE_ID",
        7 => c"NOT_FINITE",
        8 => c"INVALID_SIGMA",
        9 => c"OUTSIDE_IMAGE",
        10 => c"TOO_FEW_POINTS",
        11 => c"DEGENERATE_GEOMETRY",
        12 => c"NO_CONVERGENCE",
        13 => c"BEHIND_CAMERA",
        14 => c"NOT_TRUSTED",
        15 => c"AMBIGUOUS",
        _ => c"UNKNOWN",
    }
}

/// Writes words as a C string, cut to what there is room for.
///
/// # Safety
/// `message` is null or points to `size` bytes that nothing else uses meanwhile.
unsafe fn say(words: &str, message: *mut c_char, size: usize) {
    if message.is_null() || size == 0 {
        return;
    }
    let length = words.len().min(size - 1);
    // SAFETY: `length` is less than `size`, and the caller's bytes overlap nothing of ours.
    unsafe { std::ptr::copy_nonoverlapping(words.as_ptr().cast::<c_char>(), message, length) };
    // SAFETY: `length` is less than `size`.
    let end = unsafe { message.add(length) };
    // SAFETY: within the caller's bytes.
    unsafe { end.write(0) };
}

/// Makes an estimator for one camera and these markers, and puts it into `*made`; allocates. With any other status than
/// `TANKER_POSE_STATUS_OK` `*made` is null and `message`, if it is not null, says why in at most `message_size` bytes.
///
/// # Safety
/// `camera` and `options` are null or point to such structs, `markers` to `marker_count` of them, `made` is null or points
/// to a place for a pointer, `message` is null or points to `message_size` bytes. None of them overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tanker_pose_create(
    camera: *const Camera,
    markers: *const Marker,
    marker_count: usize,
    options: *const Options,
    made: *mut *mut Estimator,
    message: *mut c_char,
    message_size: usize,
) -> Status {
    // SAFETY: null or that many bytes, by the caller's promise.
    unsafe { say("", message, message_size) };
    guarded(|| {
        if made.is_null() || !made.is_aligned() {
            return Status::NullPointer;
        }
        // SAFETY: a valid place, by the caller's promise; what is in it is not read.
        unsafe { made.write(std::ptr::null_mut()) };
        // SAFETY: null or a valid struct, by the caller's promise.
        let camera = unsafe { element(camera) };
        // SAFETY: null or a valid struct, by the caller's promise.
        let options = unsafe { element(options) };
        // SAFETY: null or that many valid structs, by the caller's promise.
        let markers = unsafe { elements(markers, marker_count) };
        let (Some(camera), Some(options), Some(markers)) = (camera, options, markers) else {
            return Status::NullPointer;
        };
        match Estimator::new(camera, markers, options) {
            Ok(estimator) => {
                // SAFETY: as above.
                unsafe { made.write(Box::into_raw(Box::new(estimator))) };
                Status::Ok
            }
            Err(error) => {
                // SAFETY: null or that many bytes, by the caller's promise.
                unsafe { say(&error.to_string(), message, message_size) };
                error.status()
            }
        }
    })
}

/// Ends an estimator; null does nothing.
///
/// # Safety
/// `estimator` is null, or from [`tanker_pose_create`] and not yet ended, and no other call uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tanker_pose_destroy(estimator: *mut Estimator) {
    if !estimator.is_null() {
        // SAFETY: from `Box::into_raw`, and ended once, by the caller's promise.
        let estimator = unsafe { Box::from_raw(estimator) };
        guarded(move || {
            drop(estimator);
            Status::Ok
        });
    }
}

/// Estimates one frame into `*pose`. `TANKER_POSE_STATUS_OK` means that the frame has an outcome: only with
/// `TANKER_POSE_OUTCOME_OK` in `pose->outcome` is there a pose, in every other case its numbers are NaN. Allocates nothing
/// for up to `TANKER_POSE_MOST_DETECTIONS` detections; more are refused. One thread at a time may use an estimator.
///
/// # Safety
/// `estimator` is null or from [`tanker_pose_create`] and not yet ended, and no other call uses it; `detections` is null or
/// points to `detection_count` structs, `pose` is null or points to a place for a struct.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tanker_pose_estimate(
    estimator: *mut Estimator,
    detections: *const Detection,
    detection_count: usize,
    pose: *mut Pose,
) -> Status {
    guarded(|| {
        if pose.is_null() || !pose.is_aligned() {
            return Status::NullPointer;
        }
        // The caller's struct need not be initialised, so that no reference to it may be made before this.
        // SAFETY: a valid place, by the caller's promise.
        unsafe { pose.write(Pose::none()) };
        // SAFETY: written above; nothing else refers to it meanwhile, by the caller's promise.
        let Some(pose) = (unsafe { pose.as_mut() }) else {
            return Status::NullPointer;
        };
        // SAFETY: null or from `tanker_pose_create`, and used by this call alone, by the caller's promise.
        let estimator = unsafe { estimator.as_mut() };
        // SAFETY: null or that many valid structs, by the caller's promise.
        let detections = unsafe { elements(detections, detection_count) };
        let (Some(estimator), Some(detections)) = (estimator, detections) else {
            return Status::NullPointer;
        };
        estimator.estimate(detections, pose)
    })
}

/// Forgets the last trusted attitude, where `TANKER_POSE_INITIALISATION_PREVIOUS` starts: the next frame is the first.
///
/// # Safety
/// `estimator` is null or from [`tanker_pose_create`] and not yet ended, and no other call uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tanker_pose_reset(estimator: *mut Estimator) -> Status {
    guarded(|| {
        // SAFETY: null or from `tanker_pose_create`, and used by this call alone, by the caller's promise.
        let Some(estimator) = (unsafe { estimator.as_mut() }) else {
            return Status::NullPointer;
        };
        estimator.reset();
        Status::Ok
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tanker_pose::pipeline::OutcomeCode;

    #[test]
    fn outcomes_have_the_names_of_the_status_message() {
        for code in OutcomeCode::ALL {
            let name = name(code.number().into());
            assert_eq!(name.to_str(), Ok(code.name()));
        }
        assert_eq!(name(16), c"UNKNOWN");
    }

    #[test]
    fn a_panic_becomes_a_status() {
        assert_eq!(
            guarded(|| std::panic::resume_unwind(Box::new("on purpose"))),
            Status::Internal
        );
    }
}
