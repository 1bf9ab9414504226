//! Protection levels of the track hold for faults that last: constant, growing, beginning in the middle, blinking, on one
//! beacon and on two, in the worst direction.
//!
//! At 1e-7 nothing can be counted, so the risk is scaled to 1e-2 and 1e-3, with faults of 1e-2 a beacon. Approaches
//! without, with one and with two faults are flown apart and weighed by their probabilities; three faults count as
//! hazards. Bounds come from the scatter of whole approaches, since frames of one share their errors.

mod budgets;
mod support;
mod track_flight;

use budgets::{example_budget, no_budget};
use nalgebra::{Matrix1x6, Vector6};
use tanker_pose::frames::flu_from_optical;
use tanker_pose::geometry::{pose_error, skew};
use tanker_pose::integrity::{
    Beacon, Hypothesis, IntegritySettings, TrackSeparations, Unavailable,
};
use tanker_pose::simulation::{World, trial_generator};
use tanker_pose::tracking::{Filter, FilterSettings};
use track_flight::{Course, FRAMES, Fault, Flight, Moment, SIGMA_PX, TAIL, error_m};

const SEED: u64 = 31;
const PRIOR: f64 = 1e-2;
const ALLOWED: [f64; 2] = [1e-2, 1e-3];
const FALSE_ALERTS: f64 = 1e-2;

fn scaled(hmi_probability: f64) -> IntegritySettings {
    IntegritySettings {
        hmi_probability,
        fault_probability: PRIOR,
        false_alert_probability: FALSE_ALERTS,
        ..IntegritySettings::default()
    }
}

/// What became of approaches under one risk.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    flights: f64,
    frames: f64,
    available: f64,
    alerts: f64,
    hazards: f64,
    /// Sum over approaches of the square of the share of frames with a hazard.
    squares: f64,
    /// Largest error of an axis over its level.
    largest: f64,
    /// In the approach that is being flown.
    here: [f64; 2],
}

impl Tally {
    fn take(
        &mut self,
        moment: &Moment,
        levels: &Result<tanker_pose::integrity::FrameIntegrity, Unavailable>,
    ) {
        self.here[0] += 1.0;
        match levels {
            Ok(levels) => {
                self.available += 1.0;
                let error = error_m(moment, &TAIL);
                let ratio = |axis: usize| error[axis].abs() / levels.points[1].level_m[axis];
                let largest = (0..3).map(ratio).fold(0.0, f64::max);
                self.largest = self.largest.max(largest);
                self.here[1] += f64::from(u8::from(largest > 1.0));
            }
            Err(Unavailable::Fault { .. }) => self.alerts += 1.0,
            Err(_) => {}
        }
    }

    fn close(mut self) -> Self {
        let [frames, hazards] = std::mem::take(&mut self.here);
        if frames > 0.0 {
            self.flights += 1.0;
            self.frames += frames;
            self.hazards += hazards / frames;
            self.squares += (hazards / frames).powi(2);
        }
        self
    }

    fn plus(self, other: Self) -> Self {
        let (a, b) = (self.close(), other.close());
        Self {
            flights: a.flights + b.flights,
            frames: a.frames + b.frames,
            available: a.available + b.available,
            alerts: a.alerts + b.alerts,
            hazards: a.hazards + b.hazards,
            squares: a.squares + b.squares,
            largest: a.largest.max(b.largest),
            here: [0.0; 2],
        }
    }

    fn hazard(&self) -> f64 {
        self.hazards / self.flights
    }

    /// Standard error of the share of hazards; no hazard at all counts as a frame of one approach.
    fn error(&self) -> f64 {
        let least = 1.0 / f64::from(FRAMES).powi(2);
        let mean = self.hazard();
        let variance = (self.squares.max(least) / self.flights - mean * mean).max(0.0);
        (variance / self.flights).sqrt()
    }
}

fn fly(flight: &Flight, trials: u32, seed: u64, fault: &Fault) -> [Tally; 2] {
    let each = |tallies: &mut [Tally; 2], moment: &Moment| {
        for (tally, monitor) in tallies.iter_mut().zip(&flight.monitors) {
            let levels = monitor.judge_track(moment.followed, &moment.transition, &moment.motion);
            tally.take(moment, &levels);
        }
    };
    let none = [Tally::default(); 2];
    let add = |a: [Tally; 2], b: [Tally; 2]| [a[0].plus(b[0]), a[1].plus(b[1])];
    flight.sum(trials, seed, fault, &none, each, add)
}

/// Probability of 0, 1, 2 and more faults of six.
fn weights() -> [f64; 4] {
    let left = 1.0 - PRIOR;
    let (none, one, two) = (
        left.powi(6),
        6.0 * PRIOR * left.powi(5),
        15.0 * PRIOR.powi(2) * left.powi(4),
    );
    [none, one, two, 1.0 - none - one - two]
}

fn check_risk(what: &str, flight: &Flight, trials: [u32; 2]) {
    let [without, with] = trials;
    let mut strata = vec![fly(flight, without, SEED, &Fault::NONE)];
    for beacons in [1, 2] {
        let mut worst = [Tally::default(); 2];
        let courses = [
            Course::Constant,
            Course::Ramp,
            Course::FromTheMiddle,
            Course::Blinking,
        ];
        for course in courses {
            for part in [0.3, 0.6, 1.0] {
                let fault = Fault {
                    beacons,
                    course,
                    part,
                };
                let found = fly(flight, with, SEED + beacons as u64, &fault);
                for (worst, found) in worst.iter_mut().zip(found) {
                    if worst.flights == 0.0 || found.hazard() > worst.hazard() {
                        *worst = Tally {
                            largest: worst.largest.max(found.largest),
                            ..found
                        };
                    }
                    worst.largest = worst.largest.max(found.largest);
                }
            }
        }
        strata.push(worst);
    }
    let weights = weights();
    for (at, allowed) in ALLOWED.into_iter().enumerate() {
        let (mut risk, mut variance) = (weights[3], 0.0);
        for (weight, tallies) in weights.iter().zip(&strata) {
            risk += weight * tallies[at].hazard();
            variance += (weight * tallies[at].error()).powi(2);
        }
        let error = variance.sqrt();
        let (none, one, two) = (strata[0][at], strata[1][at], strata[2][at]);
        println!(
            "{what}, allowed {allowed:.0e}: found {risk:.1e} ± {error:.0e} (without a fault {:.1e}, one {:.1e}, two {:.1e}); \
             available {:.1} %, false alerts {:.2} %; largest error over level {:.2}, {:.2}, {:.2}",
            none.hazard(),
            one.hazard(),
            two.hazard(),
            100.0 * none.available / none.frames,
            100.0 * none.alerts / none.frames,
            none.largest,
            one.largest,
            two.largest,
        );
        assert!(risk < allowed + 2.0 * error, "{risk} ± {error}");
        assert!(none.available / none.frames > 0.95, "{none:?}");
        // Alerts of one approach come together: three standard errors if each had one for half of its frames.
        let of_alerts = (FALSE_ALERTS * 0.5 / none.flights).sqrt();
        assert!(none.alerts / none.frames < FALSE_ALERTS + 3.0 * of_alerts);
    }
}

#[test]
fn hazards_of_lasting_faults_are_as_rare_as_the_levels_of_the_track_say() {
    let flight = Flight::new(no_budget(), &ALLOWED.map(scaled));
    check_risk("no budget", &flight, [1_000, 80]);
}

#[test]
fn hazards_are_as_rare_in_worlds_drawn_from_a_budget() {
    let budget = example_budget(&support::tanker_markers(6));
    let flight = Flight::new(budget, &ALLOWED.map(scaled));
    check_risk("budget", &flight, [500, 25]);
}

/// The row that takes errors of the pose to the lateral error at the tail.
fn lateral(moment: &Moment) -> Vector6<f64> {
    let axes = flu_from_optical();
    let arm = moment.motion.b_from_a.rotation * TAIL.coords;
    let by_turn = axes.matrix() * -skew(arm);
    Matrix1x6::from_fn(|_, column| {
        if column < 3 {
            axes.matrix()[(1, column)]
        } else {
            by_turn[(1, column - 3)]
        }
    })
    .transpose()
}

/// Of whole approaches: a variance of this many has a standard error of a tenth.
const APPROACHES: u32 = 200;

/// Without a fault separations, and errors of the track without a beacon, scatter as they say: their squares over the
/// variances are 1 in the mean.
#[test]
fn separations_and_errors_without_a_beacon_scatter_as_they_say() {
    for (what, budget, most) in [
        ("no budget", no_budget(), 1.3),
        ("budget", example_budget(&support::tanker_markers(6)), 1.3),
    ] {
        let flight = Flight::new(budget, &[IntegritySettings::default()]);
        let ids: Vec<u32> = flight
            .map
            .markers()
            .iter()
            .map(|marker| marker.id)
            .collect();
        let pair = Hypothesis::Pair(Beacon::Marker(ids[0]), Beacon::Marker(ids[3]));
        let hypotheses: Vec<Hypothesis> = ids
            .iter()
            .map(|id| Hypothesis::Marker(*id))
            .chain([pair])
            .collect();
        let none = vec![[0.0; 3]; hypotheses.len()];
        let last = |sums: &mut Vec<[f64; 3]>, moment: &Moment| {
            // Each frame of an approach has nearly the same error.
            let a = lateral(moment);
            let whole = moment.motion.pose_covariance().0;
            let error = pose_error(&moment.truth, &moment.motion.b_from_a);
            for (sum, hypothesis) in sums.iter_mut().zip(&hypotheses) {
                let Some(found) = moment.followed.separation(hypothesis) else {
                    continue;
                };
                let of = |m: &tanker_pose::geometry::Matrix12| {
                    let block = m.fixed_view::<6, 6>(0, 0).into_owned();
                    a.dot(&(block * a))
                };
                let difference = a.dot(&found.difference.fixed_rows::<6>(0));
                // Found minus true, less what the suspects have added.
                let without = -a.dot(&error) - difference;
                sum[0] += difference.powi(2) / of(&found.covariance);
                sum[1] += without.powi(2) / (a.dot(&(whole * a)) + of(&found.more));
                sum[2] += 1.0;
            }
        };
        let add = |a: Vec<[f64; 3]>, b: Vec<[f64; 3]>| {
            let plus = |(a, b): (&[f64; 3], &[f64; 3])| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
            a.iter().zip(&b).map(plus).collect()
        };
        let sums = flight.sum(APPROACHES, SEED + 7, &Fault::NONE, &none, last, add);
        for (hypothesis, sum) in hypotheses.iter().zip(&sums) {
            let (separation, without) = (sum[0] / sum[2], sum[1] / sum[2]);
            println!(
                "{what}, {hypothesis:?}: separation {separation:.2}, error without {without:.2}"
            );
            assert!(separation > 0.7 && separation < most, "{separation}");
            // The motion is smoother than the process noise allows, so errors are smaller.
            assert!(without > 0.2 && without < most, "{without}");
        }
    }
}

/// A beacon that moves by so much does to the track exactly what its separation says, however it goes on.
#[test]
fn separation_is_what_a_fault_does_to_the_track() {
    let flight = Flight::new(no_budget(), &[IntegritySettings::default()]);
    let id = flight.map.markers()[1].id;
    for course in [
        Course::Constant,
        Course::Ramp,
        Course::FromTheMiddle,
        Course::Blinking,
    ] {
        let mut tracks = [0.0, 0.5]
            .map(|size_px| {
                let mut random = trial_generator(SEED, 1, 0, 0);
                let world = World::draw(
                    &flight.camera,
                    flight.map.markers(),
                    &flight.budget,
                    &mut random,
                );
                let mut filter = filter();
                let mut found = None;
                for frame in 0..FRAMES {
                    let mut seen = world.observe(&flight.pose(frame, 0.3), SIGMA_PX, &mut random);
                    let size = match course {
                        Course::Constant => 1.0,
                        Course::Ramp => f64::from(frame) / f64::from(FRAMES),
                        Course::FromTheMiddle => f64::from(u8::from(frame > 20)),
                        Course::Blinking => f64::from(frame % 2),
                    };
                    let shift = nalgebra::Vector2::new(size_px, -size_px);
                    flight.spoil(&mut seen, &[(id, shift)], size);
                    flight.take(&mut filter, stamp_ns(frame), &seen);
                    let track = filter.track();
                    found = track.zip(filter.follower(stamp_ns(frame))).map(
                        |(track, (followed, _))| {
                            let separation = followed.separation(&Hypothesis::Marker(id));
                            (track.motion.b_from_a, separation.expect("known").difference)
                        },
                    );
                }
                found.expect("a track")
            })
            .into_iter();
        let (Some((clean, before)), Some((spoilt, after))) = (tracks.next(), tracks.next()) else {
            unreachable!()
        };
        let moved = pose_error(&spoilt, &clean);
        let said = (after - before).fixed_rows::<6>(0).into_owned();
        let share = (moved - said).norm() / moved.norm();
        println!(
            "{course:?}: the fault moves the track by {:.4} m, its separation differs by {:.1} % of it",
            moved.fixed_rows::<3>(0).norm(),
            100.0 * share
        );
        assert!(moved.norm() > 0.005 && share < 0.02, "{moved} {said}");
    }
}

fn filter() -> Filter<TrackSeparations> {
    FilterSettings::default().checked().expect("default").into()
}

fn stamp_ns(frame: u32) -> i64 {
    1_700_000_000_000_000_000 + i64::from(frame) * 33_333_333
}
