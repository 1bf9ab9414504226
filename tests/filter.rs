//! The track is better than single frames, and its covariance says by how much.
//!
//! "NEES" is the squared error of all twelve states over its covariance; when honest it is chi-squared
//! with 12 degrees of freedom, and the sum of n independent ones has 12 n. Errors of one flight are
//! correlated for about a second (a few times `(r/q)^¼`), so values of one flight are taken two
//! seconds apart at least. Bounds are the two-sided 95 % of that law; figures are printed with
//! `--nocapture`.

mod flight;

use flight::{
    Frame, RATE_HZ, Record, approach, drawn, fly, jerk, manoeuvre, rough_approach, stamp_ns,
};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3, Vector6};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use tanker_pose::estimation::Observation;
use tanker_pose::geometry::{Vector12, motion_error, pose_error};
use tanker_pose::tracking::{Filter, FilterSettings, TrackOutcome};

/// s; until then the velocity is still being found.
const SETTLED_S: f64 = 2.0;

/// Noise that lets a drawn motion stay in view of the camera for some seconds.
const CALM: FilterSettings = FilterSettings {
    acceleration_density_mps2: 0.2,
    angular_acceleration_density_dps2: 0.5,
    manoeuvre_factor: 5.0,
    initial_speed_sigma_mps: 0.5,
    initial_rate_sigma_dps: 1.0,
    position_floor_m: 1e-6,
    attitude_floor_deg: 1e-5,
    gate_probability: 0.9999,
    max_gap_s: 1.0,
    confirm_frames: 5,
};

fn rms<const N: usize>(errors: &[SVector<f64, N>]) -> SVector<f64, N> {
    let sum: SVector<f64, N> = errors.iter().map(|e| e.component_mul(e)).sum();
    (sum / errors.len() as f64).map(f64::sqrt)
}

fn nees(record: &Record) -> f64 {
    let track = record.track.expect("a track");
    let error = motion_error(&record.truth, &track);
    track
        .mahalanobis_squared(&error)
        .expect("positive definite")
}

/// Between these the mean of `n` honest values of NEES lies with 95 % probability.
fn bounds_95(n: usize) -> (f64, f64) {
    let law = ChiSquared::new(12.0 * n as f64).expect("positive");
    (
        law.inverse_cdf(0.025) / n as f64,
        law.inverse_cdf(0.975) / n as f64,
    )
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Errors of a flight once it has settled, of the frames that have both a single pose and a track.
#[derive(Default)]
struct Errors {
    single: Vec<Vector6<f64>>,
    track: Vec<Vector12>,
    /// Two seconds apart.
    nees: Vec<f64>,
}

impl Errors {
    fn of(records: &[Record]) -> Self {
        let settled = || records.iter().filter(|r| r.time_s >= SETTLED_S);
        let both =
            || settled().filter_map(|r| Some((&r.truth, r.single.as_ref()?, r.track.as_ref()?)));
        Self {
            single: both()
                .map(|(truth, single, _)| pose_error(&truth.b_from_a, &single.camera_from_tanker))
                .collect(),
            track: both()
                .map(|(truth, _, track)| motion_error(truth, track))
                .collect(),
            nees: settled().step_by(60).map(nees).collect(),
        }
    }

    fn extend(&mut self, other: Self) {
        self.single.extend(other.single);
        self.track.extend(other.track);
        self.nees.extend(other.nees);
    }

    fn velocity_mps(&self) -> Vector3<f64> {
        rms(&self.track).fixed_rows::<3>(6).into_owned()
    }
}

/// Flies six seeds, prints and returns their errors, no seed's velocity worse than 0.15 m/s on any axis,
/// and the track better than single frames by what is demanded.
fn six_approaches(name: &str, frames_of: impl Fn(u64) -> Vec<Frame>) -> Errors {
    let mut all = Errors::default();
    for seed in 1..=6 {
        let errors = Errors::of(&fly(&frames_of(seed), &FilterSettings::default(), |_| {
            false
        }));
        println!(
            "{name}, seed {seed}: velocity {:.3?} m/s, NEES {:.1}, {} frames with a pose",
            errors.velocity_mps().as_slice(),
            mean(&errors.nees),
            errors.single.len(),
        );
        assert!(errors.velocity_mps().max() <= 0.15, "seed {seed}");
        all.extend(errors);
    }
    let (single, track) = (rms(&all.single), rms(&all.track));
    let position = |i: usize| single[i] / track[i];
    let attitude = single.fixed_rows::<3>(3).norm() / track.fixed_rows::<3>(3).norm();
    println!(
        "{name}, single frame over track: lateral {:.2}, vertical {:.2}, range {:.2}, attitude {attitude:.2}",
        position(0),
        position(1),
        position(2),
    );
    let (low, high) = bounds_95(all.nees.len());
    println!(
        "{name}, track: {:.3?} m, {:.2?} deg, {:.3?} m/s, {:.2?} deg/s; NEES {:.2} of 12, bounds {low:.2} to {high:.2}",
        track.fixed_rows::<3>(0).as_slice(),
        track.fixed_rows::<3>(3).map(f64::to_degrees).as_slice(),
        track.fixed_rows::<3>(6).as_slice(),
        track.fixed_rows::<3>(9).map(f64::to_degrees).as_slice(),
        mean(&all.nees)
    );
    assert!(attitude >= 1.8);
    assert!(position(2) >= 3.0);
    assert!(position(0) >= 2.0 && position(1) >= 2.0);
    all
}

#[test]
fn on_a_rough_approach_the_track_beats_single_frames_and_its_covariance_is_honest() {
    let errors = six_approaches("rough", |seed| {
        rough_approach(seed, &FilterSettings::default())
    });
    let (low, high) = bounds_95(errors.nees.len());
    assert!((low..=high).contains(&mean(&errors.nees)));
}

#[test]
fn on_a_smooth_approach_the_track_beats_single_frames_and_does_not_claim_too_much() {
    let errors = six_approaches("smooth", approach);
    // The noise is chosen larger than this motion needs, so only too large a NEES would be dishonest.
    assert!(mean(&errors.nees) <= bounds_95(errors.nees.len()).1);
}

#[test]
fn motions_of_the_filters_own_model_are_followed_with_an_honest_covariance() {
    const FLIGHTS: u64 = 60;
    let epochs = [60, 120, 180, 240];
    let mut at: Vec<Vec<f64>> = vec![Vec::new(); epochs.len()];
    for seed in 1..=FLIGHTS {
        let records = fly(&drawn(seed, 8.0, &CALM), &CALM, |_| false);
        for (values, &epoch) in at.iter_mut().zip(&epochs) {
            values.push(nees(&records[epoch]));
        }
    }
    let all = at.concat();
    for (values, epoch) in at.iter().zip(epochs) {
        println!(
            "{:.0} s: mean NEES {:.2}, bounds {:.2?}",
            epoch as f64 / 30.0,
            mean(values),
            bounds_95(values.len())
        );
    }
    let (low, high) = bounds_95(all.len());
    println!(
        "all: mean NEES {:.3} of 12, bounds {low:.2} to {high:.2}",
        mean(&all)
    );
    assert!((low..=high).contains(&mean(&all)));
}

#[test]
fn after_a_gap_the_prediction_is_still_honest() {
    const FLIGHTS: u64 = 100;
    // 0.4 s without detections, from 3 s on; the last lost frame is number 101.
    let lost = 90..102;
    let (mut in_gap, mut after, mut growth) = (Vec::new(), Vec::new(), 0.0);
    for seed in 1001..=1000 + FLIGHTS {
        let records = fly(&drawn(seed, 4.0, &CALM), &CALM, |k| lost.contains(&k));
        assert!(matches!(records[101].outcome, TrackOutcome::Coasting { gap_s } if gap_s > 0.39));
        assert!(matches!(records[102].outcome, TrackOutcome::Updated { .. }));
        in_gap.push(nees(&records[101]));
        after.push(nees(&records[102]));
        let sigma = |k: usize| records[k].track.expect("a track").covariance[(2, 2)].sqrt();
        growth += sigma(101) / sigma(89) / FLIGHTS as f64;
    }
    let (low, high) = bounds_95(in_gap.len());
    println!(
        "NEES {:.2} at the end of the gap, {:.2} one frame after it, bounds {low:.2} to {high:.2}; range sigma grows {growth:.2} times",
        mean(&in_gap),
        mean(&after)
    );
    assert!((low..=high).contains(&mean(&in_gap)));
    assert!((low..=high).contains(&mean(&after)));
    assert!(growth > 1.0);
}

#[test]
fn a_manoeuvre_is_noticed_and_does_not_make_the_track_claim_too_much() {
    const FLIGHTS: u8 = 10;
    const QUIET_S: f64 = 3.0;
    let fly_all = |manoeuvre_factor: f64| {
        let settings = FilterSettings {
            manoeuvre_factor,
            ..Default::default()
        };
        let (mut errors, mut values, mut gated) = (Vec::new(), Vec::new(), 0);
        for seed in 1..=FLIGHTS {
            let records = fly(&manoeuvre(seed.into(), QUIET_S, 13.0), &settings, |_| false);
            for record in records.iter().filter(|r| r.time_s >= QUIET_S) {
                let track = record.track.expect("the track never ends");
                errors.push(motion_error(&record.truth, &track));
                values.push(nees(record));
                gated += usize::from(matches!(record.outcome, TrackOutcome::Gated { .. }));
            }
        }
        let rms = rms(&errors);
        // 26.2: 99 % of honest values are below.
        let beyond = values.iter().filter(|&&v| v > 26.2).count() as f64 / values.len() as f64;
        println!(
            "factor {manoeuvre_factor}: NEES {:.1} of 12, {:.1} % beyond its 99 % limit, {gated} of {} frames gated; {:.3?} m, {:.2?} deg, {:.3?} m/s, {:.2?} deg/s",
            mean(&values),
            100.0 * beyond,
            values.len(),
            rms.fixed_rows::<3>(0).as_slice(),
            rms.fixed_rows::<3>(3).map(f64::to_degrees).as_slice(),
            rms.fixed_rows::<3>(6).as_slice(),
            rms.fixed_rows::<3>(9).map(f64::to_degrees).as_slice(),
        );
        (mean(&values), beyond)
    };
    let (honest, beyond) = fly_all(FilterSettings::default().manoeuvre_factor);
    let (too_sure, mostly) = fly_all(1.0);
    // Values of one flight are correlated: taken as one for each of its ten seconds.
    assert!(honest <= bounds_95(usize::from(FLIGHTS) * 10).1);
    // What remains is the third of a second until the manoeuvre shows.
    assert!(beyond < 0.1, "{beyond}");
    // The scenario is one that needs it.
    assert!(too_sure > 2.0 * honest && mostly > 0.5);
}

/// Faster than the gate lets the lag show: the frames that contradict the track become the next one.
#[test]
fn a_sudden_acceleration_is_followed_within_half_a_second() {
    const FLIGHTS: u64 = 20;
    const QUIET_S: f64 = 2.0;
    const MOST_FRAMES: usize = 15;
    /// Squared distance in sigmas of the pose that no honest covariance shows.
    const FAR: f64 = 60.0;
    for acceleration_mps2 in [3.0, 5.0, 10.0] {
        let (mut longest, mut swaps) = (0, 0);
        for seed in 1..=FLIGHTS {
            let frames = jerk(seed, acceleration_mps2, QUIET_S, QUIET_S + 2.0);
            let records = fly(&frames, &FilterSettings::default(), |_| false);
            let mut run = 0;
            for record in records.iter().filter(|r| r.time_s >= QUIET_S) {
                swaps += usize::from(record.outcome == TrackOutcome::Acquired);
                let is_far = record.track.is_some_and(|track| {
                    let error = pose_error(&record.truth.b_from_a, &track.b_from_a);
                    let squared = track.pose_covariance().mahalanobis_squared(&error);
                    squared.is_none_or(|squared| squared > FAR)
                });
                run = if is_far { run + 1 } else { 0 };
                longest = longest.max(run);
            }
            assert_eq!(
                run, 0,
                "{acceleration_mps2} m/s², seed {seed}: still far off"
            );
        }
        println!(
            "{acceleration_mps2} m/s²: far off for {longest} frames at most, {swaps} tracks begun anew in {FLIGHTS} flights"
        );
        assert!(
            longest <= MOST_FRAMES,
            "{acceleration_mps2} m/s²: {longest}"
        );
    }
}

/// Returns the image with the ids of every pair of left and right markers of the paper's map exchanged.
fn mirrored(observations: &[Observation]) -> Vec<Observation> {
    let other = |id: u32| match id {
        1 | 3 => id + 1,
        2 | 4 => id - 1,
        _ => id,
    };
    let pixel_of = |id: u32| observations.iter().find(|o| o.id == id).map(|o| o.pixel);
    observations
        .iter()
        .map(|seen| Observation {
            pixel: pixel_of(other(seen.id)).expect("all markers are seen"),
            ..*seen
        })
        .collect()
}

#[test]
fn an_image_with_left_and_right_exchanged_does_not_move_the_track() {
    let frames = drawn(7, 4.0, &CALM);
    let mut with_wrong = drawn(7, 4.0, &CALM);
    let wrong = [60, 75, 76, 90];
    for k in wrong {
        with_wrong[k].observations = mirrored(&frames[k].observations);
    }
    // Refused as a single frame, it is as if it had been lost.
    let lost = fly(&frames, &CALM, |k| wrong.contains(&k));
    let found = fly(&with_wrong, &CALM, |_| false);
    assert!(wrong.iter().all(|&k| found[k].single.is_none()));
    assert!(found.iter().zip(&lost).all(|(a, b)| a.track == b.track));
}

#[test]
fn a_wrong_pose_that_a_single_frame_trusts_does_not_move_the_track() {
    let records = fly(&drawn(8, 3.0, &CALM), &CALM, |_| false);
    let mut filter = Filter::new(CALM).expect("settings in range");
    for (k, record) in records.iter().enumerate() {
        let single = record.single.as_ref().expect("a pose");
        let stamp = stamp_ns(k as f64 / RATE_HZ);
        filter.update(stamp, &single.camera_from_tanker, &single.covariance);
    }
    let before = filter.track().expect("a track");
    let last = records
        .last()
        .and_then(|r| r.single.as_ref())
        .expect("a pose");
    // The mirrored tanker in front of the camera, one turned by 15 degrees, one two metres to the side.
    let about = |axis: Vector3<f64>| UnitQuaternion::from_scaled_axis(axis);
    let right = last.camera_from_tanker;
    for (stamp_after_ns, turn, shift) in [
        (
            33_000_000,
            about(Vector3::y() * std::f64::consts::PI),
            Vector3::zeros(),
        ),
        (
            66_000_000,
            about(Vector3::z() * 15.0_f64.to_radians()),
            Vector3::zeros(),
        ),
        (99_000_000, UnitQuaternion::identity(), Vector3::x() * 2.0),
    ] {
        let stamp = before.stamp_ns + stamp_after_ns;
        let wrong = Isometry3::from_parts(
            Translation3::from(right.translation.vector + shift),
            turn * right.rotation,
        );
        let outcome = filter.update(stamp, &wrong, &last.covariance);
        assert!(
            matches!(outcome, TrackOutcome::Gated { innovation_squared, limit } if innovation_squared > limit),
            "{outcome:?}"
        );
        assert_eq!(filter.track(), Some(before));
    }
}
