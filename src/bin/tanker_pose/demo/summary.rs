//! The results of the flight.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::io::Write;

use serde::Serialize;
use tanker_pose::pipeline::OutcomeCode;

use super::ledger::{Estimate, Frame, Ledger};
use super::statistics::{POSE_DEGREES_OF_FREEDOM, mean, mean_nees_interval, percentile, rms};
use super::words::plainly;

/// Parts of the route.
const BINS: [&str; 3] = ["far", "middle", "near"];

/// All numbers, in the units of their names.
#[derive(Debug, Serialize)]
pub struct Summary {
    interrupted: bool,
    sent: usize,
    estimates: usize,
    refusals: usize,
    missing: usize,
    refusals_by_outcome: BTreeMap<String, Refusals>,
    injected: Injected,
    accuracy: Vec<Bin>,
    nees: Nees,
    latency_ms: Times,
    solve_time_ms: Times,
}

#[derive(Debug, Default, Serialize)]
struct Refusals {
    frames: usize,
    of_which_injected: usize,
}

#[derive(Debug, Serialize)]
struct Injected {
    frames: usize,
    estimated_without_the_marker: usize,
    refused: usize,
    taken_for_good: usize,
}

/// Errors in one part of the route.
#[derive(Debug, Serialize)]
struct Bin {
    part: &'static str,
    from_ahead_m: f64,
    to_ahead_m: f64,
    estimates: usize,
    /// Right, down, ahead.
    position_rmse_m: [Option<f64>; 3],
    /// Angle of the whole rotation.
    attitude_rmse_deg: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Nees {
    mean: Option<f64>,
    expected: f64,
    expected_interval_95: Option<[f64; 2]>,
    /// Something is off for many images: the flight's mean is about one draw.
    one_draw: bool,
}

#[derive(Debug, Serialize)]
struct Times {
    p50: Option<f64>,
    p99: Option<f64>,
    max: Option<f64>,
}

impl Summary {
    /// Returns the numbers of a flight.
    ///
    /// # Inputs
    /// * `is_one_draw`: whether something is off for the whole of it. Its mean NEES then is a weighted sum of six squared
    ///   normal numbers of which none weighs more than 1, plus the mean of what is drawn for each frame. With all
    ///   weights 1 it varies most: as the NEES of a single frame.
    pub fn new(ledger: &Ledger, interrupted: bool, is_one_draw: bool) -> Self {
        let trusted: Vec<&Estimate> = ledger.frames().filter_map(Frame::trusted).collect();
        let nees: Vec<f64> = trusted.iter().map(|estimate| estimate.nees).collect();
        let refusals_by_outcome = refusals(ledger);
        let solve_time_ms: Vec<f64> = ledger
            .frames()
            .filter_map(|frame| Some(frame.verdict.as_ref()?.solve_time.as_secs_f64() * 1e3))
            .collect();
        Self {
            interrupted,
            sent: ledger.sent(),
            estimates: trusted.len(),
            refusals: refusals_by_outcome.values().map(|all| all.frames).sum(),
            missing: ledger.missing(),
            refusals_by_outcome,
            injected: injected(ledger),
            accuracy: accuracy(ledger),
            nees: Nees {
                mean: mean(&nees),
                expected: POSE_DEGREES_OF_FREEDOM,
                expected_interval_95: mean_nees_interval(if is_one_draw {
                    nees.len().min(1)
                } else {
                    nees.len()
                }),
                one_draw: is_one_draw,
            },
            latency_ms: Times::new(&ledger.latencies_ms()),
            solve_time_ms: Times::new(&solve_time_ms),
        }
    }

    /// Returns how many frames got no outcome.
    pub const fn missing(&self) -> usize {
        self.missing
    }

    /// Prints it as text, or as one JSON object.
    pub fn print(&self, json: bool) {
        let text = if json {
            serde_json::to_string(self).unwrap_or_else(|error| error.to_string())
        } else {
            self.to_string()
        };
        // A reader that has seen enough is no fault.
        let _ = writeln!(std::io::stdout(), "{text}");
    }
}

fn refusals(ledger: &Ledger) -> BTreeMap<String, Refusals> {
    let mut all: BTreeMap<String, Refusals> = BTreeMap::new();
    for frame in ledger.frames() {
        let Some(verdict) = &frame.verdict else {
            continue;
        };
        if verdict.code != OutcomeCode::Ok {
            let refusals = all.entry(plainly(verdict.code)).or_default();
            refusals.frames += 1;
            refusals.of_which_injected += usize::from(frame.fault.is_some());
        }
    }
    all
}

fn injected(ledger: &Ledger) -> Injected {
    let faulty = || ledger.frames().filter(|frame| frame.fault.is_some());
    let (found, taken): (Vec<&Frame>, Vec<&Frame>) = faulty()
        .filter(|frame| frame.is_answered())
        .partition(|frame| frame.fault_was_found());
    let estimated = found.iter().filter(|frame| frame.trusted().is_some());
    let estimated_without_the_marker = estimated.count();
    Injected {
        frames: faulty().count(),
        estimated_without_the_marker,
        refused: found.len() - estimated_without_the_marker,
        taken_for_good: taken.len(),
    }
}

/// Three parts of equal length between the farthest and the nearest frame.
fn accuracy(ledger: &Ledger) -> Vec<Bin> {
    let distances = || ledger.frames().map(Frame::ahead_m);
    let far = distances().fold(f64::MIN, f64::max);
    let step = (far - distances().fold(f64::MAX, f64::min)) / BINS.len() as f64;
    let bin = |(k, part): (usize, &'static str)| {
        let from_ahead_m = far - step * k as f64;
        let to_ahead_m = from_ahead_m - step;
        let is_last = k + 1 == BINS.len();
        let errors: Vec<_> = ledger
            .frames()
            .filter(|frame| frame.ahead_m() <= from_ahead_m)
            .filter(|frame| frame.ahead_m() > to_ahead_m || is_last)
            .filter_map(|frame| Some(frame.trusted()?.error))
            .collect();
        Bin {
            part,
            from_ahead_m,
            to_ahead_m,
            estimates: errors.len(),
            position_rmse_m: std::array::from_fn(|axis| rms(errors.iter().map(|e| e[axis]))),
            attitude_rmse_deg: rms(errors.iter().map(|e| e.fixed_rows::<3>(3).norm()))
                .map(f64::to_degrees),
        }
    };
    BINS.into_iter().enumerate().map(bin).collect()
}

impl Times {
    fn new(values: &[f64]) -> Self {
        Self {
            p50: percentile(values, 0.5),
            p99: percentile(values, 0.99),
            max: percentile(values, 1.0),
        }
    }
}

impl Display for Times {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let ms = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let (p50, p99, max) = (ms(self.p50), ms(self.p99), ms(self.max));
        write!(out, "p50 {p50:.2} ms, p99 {p99:.2} ms, max {max:.2} ms")
    }
}

impl Display for Summary {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let end = if self.interrupted {
            ", interrupted"
        } else {
            ""
        };
        writeln!(
            out,
            "\nSummary{end}\n  frames      {} sent: {} estimates, {} refusals, {} without an outcome",
            self.sent, self.estimates, self.refusals, self.missing
        )?;
        let refusals: Vec<String> = self
            .refusals_by_outcome
            .iter()
            .map(|(outcome, n)| {
                format!("{} {outcome} ({} injected)", n.frames, n.of_which_injected)
            })
            .collect();
        if !refusals.is_empty() {
            writeln!(out, "  refusals    {}", refusals.join(", "))?;
        }
        let injected = &self.injected;
        writeln!(
            out,
            "  injected    {} faulty frames: {} estimated without the wrong marker, {} refused, {} accepted as good",
            injected.frames,
            injected.estimated_without_the_marker,
            injected.refused,
            injected.taken_for_good
        )?;
        writeln!(
            out,
            "  RMS error             right      down     ahead   attitude   estimates"
        )?;
        for bin in &self.accuracy {
            let cm = |axis: usize| bin.position_rmse_m[axis].unwrap_or(f64::NAN) * 100.0;
            writeln!(
                out,
                "    {:<7}{:<9} {:6.2} cm {:6.2} cm {:6.2} cm  {:6.3} deg  {:6}",
                bin.part,
                format!("{:.0}-{:.0} m", bin.from_ahead_m, bin.to_ahead_m),
                cm(0),
                cm(1),
                cm(2),
                bin.attitude_rmse_deg.unwrap_or(f64::NAN),
                bin.estimates
            )?;
        }
        let [low, high] = self.nees.expected_interval_95.unwrap_or([f64::NAN; 2]);
        let (mean, expected) = (self.nees.mean.unwrap_or(f64::NAN), self.nees.expected);
        let honest = if self.nees.one_draw {
            format!("honest ones give {expected} on average over worlds, and in 95 % of them")
        } else {
            format!("an honest one gives {expected} (95 %:")
        };
        let end = if self.nees.one_draw { "" } else { ")" };
        writeln!(
            out,
            "  covariance  mean NEES {mean:.2}; {honest} {low:.2} to {high:.2}{end}"
        )?;
        writeln!(
            out,
            "  latency     {}, detections published to pose received",
            self.latency_ms
        )?;
        write!(out, "  solve time  {}, inside the node", self.solve_time_ms)
    }
}
