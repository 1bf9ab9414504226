//! Axes of a chart: limits, ticks, places in pixels.

/// How values become places.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Linear,
    Logarithmic,
}

/// One axis with its ticks.
#[derive(Debug, Clone)]
pub(super) struct Scale {
    kind: Kind,
    /// In plotted values: exponents on a logarithmic axis.
    low: f64,
    high: f64,
    from_px: f64,
    to_px: f64,
    ticks: Vec<(f64, String)>,
}

impl Scale {
    /// Returns a linear axis from `low` to `high`.
    pub(super) fn linear(low: f64, high: f64, from_px: f64, to_px: f64) -> Self {
        let (low, high) = widened(low, high);
        let step = nice_step((high - low) / 6.0);
        let decimals = decimals(step);
        let ticks = multiples(step, low, high)
            .map(|value| (value, label(value, decimals)))
            .collect();
        Self {
            kind: Kind::Linear,
            low,
            high,
            from_px,
            to_px,
            ticks,
        }
    }

    /// Returns an axis of names, the first at 1, each with room of half a step on both sides.
    pub(super) fn named(names: &[String], from_px: f64, to_px: f64) -> Self {
        // More are not read.
        const MOST: usize = 20;
        let step = names.len().div_ceil(MOST).max(1);
        let ticks = names.iter().enumerate().step_by(step);
        Self {
            kind: Kind::Linear,
            low: 0.5,
            high: names.len().max(1) as f64 + 0.5,
            from_px,
            to_px,
            ticks: ticks
                .map(|(index, name)| (index as f64 + 1.0, name.clone()))
                .collect(),
        }
    }

    /// Returns a logarithmic axis about positive values.
    pub(super) fn logarithmic(low: f64, high: f64, from_px: f64, to_px: f64) -> Self {
        let low = low.max(1e-12).log10();
        let (low, high) = widened(low, high.max(1e-12).log10().max(low));
        let mantissas: &[f64] = if high - low > 2.0 {
            &[1.0]
        } else {
            &[1.0, 2.0, 5.0]
        };
        let ticks = multiples(1.0, low.floor(), high)
            .flat_map(|decade| {
                mantissas
                    .iter()
                    .map(move |mantissa| decade + mantissa.log10())
            })
            .filter(|exponent| (low..=high).contains(exponent))
            .map(|exponent| (exponent, power_label(exponent)))
            .collect();
        Self {
            kind: Kind::Logarithmic,
            low,
            high,
            from_px,
            to_px,
            ticks,
        }
    }

    /// Returns where a value is; beyond the limits on the edge, `None` where it has no place.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        let plotted = match self.kind {
            Kind::Linear => value,
            Kind::Logarithmic => value.log10(),
        };
        (!plotted.is_nan()).then(|| self.at(plotted.clamp(self.low, self.high)))
    }

    fn at(&self, plotted: f64) -> f64 {
        let share = (plotted - self.low) / (self.high - self.low);
        self.from_px + share * (self.to_px - self.from_px)
    }

    /// Returns the ticks: places and labels.
    pub(super) fn ticks(&self) -> impl Iterator<Item = (f64, &str)> {
        self.ticks
            .iter()
            .map(|(plotted, label)| (self.at(*plotted), label.as_str()))
    }
}

/// Returns limits that differ and are finite.
fn widened(low: f64, high: f64) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite()) {
        return (0.0, 1.0);
    }
    if high - low > 1e-12 * high.abs().max(low.abs()) {
        return (low, high);
    }
    let room = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
    (low - room, high + room)
}

fn nice_step(raw: f64) -> f64 {
    let power = 10_f64.powf(raw.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= raw * (1.0 - 1e-9))
        .unwrap_or(power)
}

fn multiples(step: f64, low: f64, high: f64) -> impl Iterator<Item = f64> {
    let first = (low / step - 1e-9).ceil();
    (0..60_u32)
        .map(move |index| (first + f64::from(index)) * step)
        .take_while(move |value| *value <= high + 1e-9 * step)
}

/// Returns the digits after the point that tell steps apart.
fn decimals(step: f64) -> usize {
    // At most a dozen.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let digits = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    digits
}

fn label(value: f64, decimals: usize) -> String {
    if value.abs() >= 1e6 {
        return format!("{value:.1e}");
    }
    // Without a minus before a zero.
    format!("{:.decimals$}", value + 0.0)
}

fn power_label(exponent: f64) -> String {
    let value = 10_f64.powf(exponent);
    if (1e-3..1e5).contains(&value) {
        format!("{}", (value * 1e6).round() / 1e6)
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let scale = Scale::linear(-0.31, 0.44, 0.0, 100.0);
        let labels: Vec<&str> = scale.ticks().map(|(_, label)| label).collect();
        assert_eq!(labels, ["-0.2", "0.0", "0.2", "0.4"]);
        assert!(
            scale
                .ticks()
                .all(|(place, _)| (0.0..=100.0).contains(&place))
        );
        let scale = Scale::logarithmic(0.02, 300.0, 0.0, 100.0);
        let labels: Vec<&str> = scale.ticks().map(|(_, label)| label).collect();
        assert_eq!(labels, ["0.1", "1", "10", "100"]);
    }

    #[test]
    fn no_value_leaves_the_chart_and_none_is_placed_without_one() {
        let scale = Scale::linear(0.0, 1.0, 10.0, 20.0);
        assert_eq!(scale.place(f64::NAN), None);
        for value in [f64::INFINITY, -5.0, 0.5] {
            let place = scale.place(value).expect("on the chart");
            assert!((10.0..=20.0).contains(&place));
        }
        // Equal, infinite and missing limits give a chart all the same.
        for (low, high) in [
            (3.0, 3.0),
            (0.0, 0.0),
            (f64::NAN, 1.0),
            (0.0, f64::INFINITY),
        ] {
            let scale = Scale::linear(low, high, 0.0, 1.0);
            assert!(scale.ticks().count() > 1, "{low} {high}");
        }
    }
}
