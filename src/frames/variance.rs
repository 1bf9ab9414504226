//! Variances and standard deviations, in the single precision of PX4's messages.

/// A variance or standard deviation that a flight stack would reject.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "expected a finite positive number in single precision on axis {axis}, got {got:?}: flight stacks reject anything else"
)]
pub struct VarianceError {
    /// Index of the value.
    pub axis: usize,
    /// The value before conversion.
    pub got: f64,
}

fn single<const N: usize>(
    given: &[f64; N],
    wanted: impl Fn(f64) -> f64,
) -> Result<[f32; N], VarianceError> {
    let mut result = [0.0; N];
    for axis in 0..N {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "rounds; too small becomes zero and too large infinite, which is refused below"
        )]
        let value = wanted(given[axis]) as f32;
        if !(value > 0.0 && value.is_finite()) {
            return Err(VarianceError {
                axis,
                got: given[axis],
            });
        }
        result[axis] = value;
    }
    Ok(result)
}

/// Returns variances in single precision, for PX4's fields that are variances (`variance`, `cov_*`).
///
/// # Errors
/// [`VarianceError`] for values that are not finite or not positive, also after rounding to single precision.
pub fn px4_variances<const N: usize>(variances: &[f64; N]) -> Result<[f32; N], VarianceError> {
    single(variances, |variance| variance)
}

/// Returns the standard deviations of these variances, for PX4's fields that are standard deviations (`std_*`).
///
/// # Errors
/// As [`px4_variances`].
pub fn px4_standard_deviations<const N: usize>(
    variances: &[f64; N],
) -> Result<[f32; N], VarianceError> {
    single(variances, f64::sqrt)
}

/// Returns the variances from standard deviations of a flight stack.
///
/// # Errors
/// As [`px4_variances`]; the reported value is the standard deviation.
pub fn variances_from<const N: usize>(
    standard_deviations: &[f32; N],
) -> Result<[f64; N], VarianceError> {
    let given = standard_deviations.map(f64::from);
    single(&given, |sigma| sigma)?;
    Ok(given.map(|sigma| sigma * sigma))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_and_standard_deviation_are_each_others_square() {
        let variances = [4.0, 0.25, 1e-6];
        assert_eq!(px4_standard_deviations(&variances), Ok([2.0, 0.5, 1e-3]));
        assert_eq!(px4_variances(&variances), Ok([4.0, 0.25, 1e-6]));
        assert_eq!(variances_from(&[2.0, 0.5]), Ok([4.0, 0.25]));
    }

    #[test]
    fn what_flight_stacks_reject_is_an_error_here() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-60, 1e60] {
            let error = px4_variances(&[1.0, wrong]).expect_err("not a variance");
            assert_eq!(error.axis, 1);
        }
        // Its square root still has a place in single precision.
        assert!(px4_standard_deviations(&[1e-60]).is_ok());
        assert!(px4_standard_deviations(&[-1.0]).is_err());
        assert!(variances_from(&[f32::NAN]).is_err());
    }
}
