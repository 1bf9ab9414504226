//! Numbers as tables show them.

use crate::text::digits;

/// What is shown for what could not be computed.
pub(super) const NONE: &str = "–";

/// Returns a number with three significant digits.
pub(super) fn number(value: f64) -> String {
    if value.is_finite() {
        digits(value)
    } else {
        NONE.to_owned()
    }
}

/// Returns a number with three significant digits, or the sign for none.
pub(super) fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| NONE.to_owned(), number)
}

/// Returns a number in thousandths: of metres, radians or seconds.
pub(super) fn milli(value: Option<f64>) -> String {
    optional(value.map(|value| 1e3 * value))
}

/// Returns a share in per cent, with the digits that matter near one.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent > 99.0 && percent < 100.0 {
        format!("{percent:.2} %")
    } else {
        format!("{percent:.1} %")
    }
}

/// Returns an interval of shares in per cent.
pub(super) fn percents(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(
        || NONE.to_owned(),
        |[low, high]| format!("{} to {}", percent(low), percent(high)),
    )
}

/// Returns an interval.
pub(super) fn interval(bounds: Option<[f64; 2]>) -> String {
    bounds.map_or_else(
        || NONE.to_owned(),
        |[low, high]| format!("{low:.2} to {high:.2}"),
    )
}

/// Returns a probability; below what a table can show, an upper bound.
pub(super) fn probability(value: f64) -> String {
    if value < 1e-12 {
        "< 1e-12".to_owned()
    } else {
        number(value)
    }
}
