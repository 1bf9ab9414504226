//! Inverse of an increasing function.

/// Returns the `x` in `[0, upper]` where an increasing function reaches a target, by Newton's method within a bracket.
///
/// `function` returns value and slope, with value 0 at 0; a target above the value at `upper` gives `upper`. The number
/// of steps is bounded for every function.
pub(super) fn solve_rising(target: f64, upper: f64, function: impl Fn(f64) -> (f64, f64)) -> f64 {
    /// Bisection alone needs about 60 from any bracket.
    const MAX_STEPS: usize = 120;
    let (mut low, mut high) = (0.0, upper);
    let mut x = target.min(upper);
    for _ in 0..MAX_STEPS {
        let (value, slope) = function(x);
        if value < target {
            low = x;
        } else {
            high = x;
        }
        let newton = x - (value - target) / slope;
        // A step out of the bracket, or NaN, becomes a bisection.
        let next = if newton >= low && newton <= high {
            newton
        } else {
            f64::midpoint(low, high)
        };
        if (next - x).abs() <= f64::EPSILON * x {
            return next;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_function_is_solved_whatever_its_slope_says() {
        let cube = |x: f64| (x * x * x, 3.0 * x * x);
        let lying = |x: f64| (x * x * x, -1.0);
        let silent = |x: f64| (x * x * x, f64::NAN);
        assert!((solve_rising(8.0, 10.0, cube) - 2.0).abs() < 1.0e-14);
        assert!((solve_rising(8.0, 10.0, lying) - 2.0).abs() < 1.0e-14);
        assert!((solve_rising(8.0, 10.0, silent) - 2.0).abs() < 1.0e-14);
        assert!((solve_rising(2000.0, 10.0, cube) - 10.0).abs() < 1.0e-14);
        assert!(solve_rising(0.0, 10.0, cube).abs() < 1.0e-14);
    }
}
