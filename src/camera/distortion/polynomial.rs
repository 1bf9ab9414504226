//! Smallest roots of polynomials, which determine a lens model's valid region.

/// Returns the value of a polynomial, `coefficients` from the constant term up.
pub(super) fn evaluate(coefficients: &[f64], x: f64) -> f64 {
    coefficients
        .iter()
        .rev()
        .fold(0.0, |sum, coefficient| sum * x + coefficient)
}

/// Returns the product of two polynomials.
pub(super) fn multiply(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// Returns the derivative of a polynomial.
pub(super) fn derivative(coefficients: &[f64]) -> Vec<f64> {
    coefficients
        .iter()
        .enumerate()
        .skip(1)
        .map(|(power, coefficient)| power as f64 * coefficient)
        .collect()
}

/// Returns the smallest `x` in `(0, upper)` where the polynomial changes sign, if any.
pub(super) fn first_sign_change(coefficients: &[f64], upper: f64) -> Option<f64> {
    sign_changes(coefficients, upper).first().copied()
}

/// Returns all `x` in `(0, upper)` where the polynomial changes sign, ascending.
///
/// Between neighbouring sign changes of its derivative a polynomial is monotone, so each such interval contains at most
/// one, which bisection finds without a start value. (A derivative that only touches zero does not end a monotone
/// interval.)
fn sign_changes(coefficients: &[f64], upper: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let mut ends = sign_changes(&derivative(coefficients), upper);
    ends.push(upper);
    let mut found = Vec::new();
    let mut start = 0.0;
    for end in ends {
        let rises = evaluate(coefficients, start) < 0.0;
        if rises != (evaluate(coefficients, end) < 0.0) {
            found.push(bisect(start, end, |x| {
                (evaluate(coefficients, x) < 0.0) == rises
            }));
        }
        start = end;
    }
    found
}

/// Returns the last `x` at which `still` holds, to rounding, given that it holds at `start` and not at `end`.
pub(super) fn bisect(mut start: f64, mut end: f64, still: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = f64::midpoint(start, end);
        if middle <= start || middle >= end {
            return start;
        }
        if still(middle) {
            start = middle;
        } else {
            end = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Relative error of a simple root by bisection.
    const ROOT_TOLERANCE: f64 = 1.0e-9;

    #[test]
    fn polynomials_without_a_sign_change_have_none() {
        for coefficients in [
            &[][..],
            &[1.0],
            &[1.0, 0.0, 0.0],
            &[1.0, 2.0, 3.0],
            &[1.0, -2.0, 1.01],
        ] {
            assert_eq!(
                first_sign_change(coefficients, 100.0),
                None,
                "{coefficients:?}"
            );
        }
    }

    #[test]
    fn a_root_beyond_the_upper_end_is_not_found() {
        assert_eq!(first_sign_change(&[1.0, -0.1], 9.0), None);
        assert!(first_sign_change(&[1.0, -0.1], 11.0).is_some());
    }

    #[test]
    fn two_roots_close_together_are_not_stepped_over() {
        // (x - 1)(x - 1.0001)
        let root = first_sign_change(&[1.0001, -2.0001, 1.0], 50.0).expect("it dips below zero");
        assert!((root - 1.0).abs() < ROOT_TOLERANCE);
    }

    proptest! {
        #[test]
        fn the_smallest_of_the_roots_is_found(
            gaps in prop::collection::vec(0.05_f64..1.0, 1..6),
        ) {
            let mut coefficients = vec![1.0];
            let mut root = 0.0;
            for gap in &gaps {
                root += gap;
                coefficients = multiply(&coefficients, &[1.0, -1.0 / root]);
            }
            let found = first_sign_change(&coefficients, 10.0).expect("all roots lie below 6");
            prop_assert!((found - gaps[0]).abs() < 1.0e-6 * gaps[0], "{} for {}", found, gaps[0]);
        }
    }
}
