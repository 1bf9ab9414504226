//! Axes: limits and ticks.
//!
//! Ticks are chosen here and both axes stay linear inside (a logarithmic one plots exponents), so one
//! type of chart serves every panel.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};

/// More would not be read.
const MAX_TICKS: u16 = 50;

#[derive(Clone, Copy)]
pub enum Axis {
    /// From zero to the largest value.
    FromZero,
    /// The powers of ten about all values.
    Logarithmic,
    /// From the first to the second, by powers of ten; a value beyond them is drawn on the edge.
    Decades(f64, f64),
    /// These limits; a value beyond them is drawn on the edge.
    Within(f64, f64),
}

/// Limits and ticks, in plotted values.
#[derive(Clone)]
pub struct Scale {
    min: f64,
    max: f64,
    ticks: Vec<f64>,
    is_logarithmic: bool,
}

impl Scale {
    pub fn new(axis: Axis, values: impl Iterator<Item = f64> + Clone) -> Self {
        let finite = values.filter(|value| value.is_finite());
        match axis {
            Axis::FromZero => {
                let max = finite.fold(f64::MIN_POSITIVE, f64::max);
                Self::linear(0.0, 1.08 * max)
            }
            Axis::Within(min, max) => Self::linear(min, max),
            Axis::Decades(min, max) => Self::logarithmic(min, max),
            Axis::Logarithmic => {
                let positive = finite.filter(|value| *value > 0.0);
                let min = positive.clone().fold(f64::MAX, f64::min);
                let max = positive.fold(f64::MIN_POSITIVE, f64::max);
                Self::logarithmic(min / 1.15, max * 1.15)
            }
        }
    }

    /// All of these, with a little room at both ends.
    pub fn around(values: impl Iterator<Item = f64> + Clone) -> Self {
        let min = values.clone().fold(f64::INFINITY, f64::min);
        let max = values.fold(f64::NEG_INFINITY, f64::max);
        let room = 0.04 * (max - min);
        Self::linear(min - room, max + room)
    }

    fn linear(min: f64, max: f64) -> Self {
        /// About this many steps.
        const STEPS: f64 = 6.0;
        let raw = (max - min) / STEPS;
        let power = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|factor| factor * power)
            .find(|step| *step >= raw)
            .unwrap_or(power);
        Self {
            min,
            max,
            ticks: multiples(step, min, max),
            is_logarithmic: false,
        }
    }

    fn logarithmic(min: f64, max: f64) -> Self {
        let (low, high) = (min.log10(), max.log10());
        // Over more than two decades the powers of ten are enough.
        let mantissas: &[f64] = if high - low > 2.0 {
            &[1.0]
        } else {
            &[1.0, 2.0, 5.0]
        };
        let ticks = multiples(1.0, low.floor(), high)
            .into_iter()
            .flat_map(|decade| mantissas.iter().map(move |m| decade + m.log10()))
            .filter(|tick| (low..=high).contains(tick))
            .collect();
        Self {
            min: low,
            max: high,
            ticks,
            is_logarithmic: true,
        }
    }

    /// Where a value is drawn; nowhere when it has no place on this axis.
    pub fn place(&self, value: f64) -> Option<f64> {
        let value = if self.is_logarithmic {
            value.log10()
        } else {
            value
        };
        value.is_finite().then(|| value.clamp(self.min, self.max))
    }

    pub fn label(&self, tick: f64) -> String {
        let value = if self.is_logarithmic {
            10_f64.powf(tick)
        } else {
            tick
        };
        // Ticks have one or two figures; what is beyond is rounding.
        format!("{}", (value * 1e4).round() / 1e4 + 0.0)
    }
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (value - self.min) / (self.max - self.min);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "values are clamped to the limits, so the pixel lies between the two given"
        )]
        let offset = (share * f64::from(to - from)).round() as i32;
        from + offset
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.min..self.max
    }
}

fn multiples(step: f64, min: f64, max: f64) -> Vec<f64> {
    let first = (min / step).ceil();
    (0..MAX_TICKS)
        .map(|k| (first + f64::from(k)) * step)
        .take_while(|tick| *tick <= max + 1e-9 * step)
        .collect()
}
