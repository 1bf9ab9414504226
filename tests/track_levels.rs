//! What the track's protection levels are, and that they follow the track: late frames, new tracks, beacons that come and
//! go, faults that no single frame shows.

mod budgets;
mod support;
mod track_flight;

use budgets::{example_budget, no_budget};
use nalgebra::Vector2;
use tanker_pose::integrity::{Hypothesis, IntegritySettings, TrackSeparations, Unavailable};
use tanker_pose::simulation::{World, trial_generator};
use tanker_pose::tracking::{Filter, FilterSettings, TrackOutcome};
use track_flight::{Course, FRAMES, Fault, Flight, Moment, SIGMA_PX, TAIL, error_m};

const SEED: u64 = 77;

fn filter() -> Filter<TrackSeparations> {
    FilterSettings::default().checked().expect("default").into()
}

fn stamp_ns(frame: u32) -> i64 {
    1_700_000_000_000_000_000 + i64::from(frame) * 33_333_333
}

/// Frames of one approach without a fault.
fn frames(flight: &Flight) -> Vec<Vec<tanker_pose::estimation::Observation>> {
    let mut random = trial_generator(SEED, 2, 0, 0);
    let world = World::draw(
        &flight.camera,
        flight.map.markers(),
        &flight.budget,
        &mut random,
    );
    let seen = |frame| world.observe(&flight.pose(frame, 0.3), SIGMA_PX, &mut random);
    (0..FRAMES).map(seen).collect()
}

#[test]
fn levels_follow_late_frames_bit_for_bit() {
    let budget = example_budget(&support::tanker_markers(6));
    let flight = Flight::new(budget, &[IntegritySettings::default()]);
    let mut frames = frames(&flight);
    // A beacon is first seen in the late frame, another only before it.
    frames[30..]
        .iter_mut()
        .for_each(|seen| seen.retain(|seen| seen.id != 2));
    frames[..29]
        .iter_mut()
        .for_each(|seen| seen.retain(|seen| seen.id != 5));
    let order = |late: bool| {
        let mut order: Vec<u32> = (0..FRAMES).collect();
        if late {
            // The 30th comes after the 33rd.
            order[29..33].rotate_left(1);
        }
        order
    };
    let [in_order, late] = [false, true].map(|late| {
        let mut filter = filter();
        for frame in order(late) {
            flight.take(&mut filter, stamp_ns(frame), &frames[frame as usize]);
        }
        let (followed, _) = filter.follower(stamp_ns(FRAMES - 1)).expect("a track");
        followed.clone()
    });
    assert_eq!(in_order, late);
    assert!(in_order.separation(&Hypothesis::Marker(5)).is_some());
}

#[test]
fn separation_of_a_beacon_that_is_gone_fades_and_a_new_track_has_none_of_it() {
    let flight = Flight::new(no_budget(), &[IntegritySettings::default()]);
    let mut frames = frames(&flight);
    // Half of what makes an alert: in the track, but no single frame leaves it out.
    for seen in &mut frames[..20] {
        flight.spoil(seen, &[(2, Vector2::new(2.0, 1.0))], 1.0);
    }
    frames[20..]
        .iter_mut()
        .for_each(|seen| seen.retain(|seen| seen.id != 2));
    let mut filter = filter();
    let mut sizes = Vec::new();
    for (frame, seen) in (0..).zip(&frames) {
        flight.take(&mut filter, stamp_ns(frame), seen);
        if let Some((followed, _)) = filter.follower(stamp_ns(frame)) {
            let found = followed.separation(&Hypothesis::Marker(2)).expect("known");
            sizes.push(found.difference.fixed_rows::<3>(0).norm());
        }
    }
    let (there, gone) = (sizes[sizes.len() - 26], sizes[sizes.len() - 1]);
    println!("separation {there:.4} m with the beacon, {gone:.4} m 0.8 s after it");
    assert!(there > 0.01 && gone < 0.2 * there, "{there} {gone}");

    filter.reset();
    assert!(filter.follower(stamp_ns(FRAMES)).is_none());
    for frame in FRAMES..FRAMES + 10 {
        flight.take(&mut filter, stamp_ns(frame), &frames[44]);
    }
    let (followed, transition) = filter.follower(stamp_ns(FRAMES + 9)).expect("a track");
    assert_eq!(followed.separation(&Hypothesis::Marker(2)), None);
    let motion = filter.predict(stamp_ns(FRAMES + 9)).expect("a track");
    // Five beacons: without two of them three are left.
    let levels = flight.monitors[0].judge_track(followed, &transition, &motion);
    assert!(
        matches!(levels, Err(Unavailable::Unmonitored { .. })),
        "{levels:?}"
    );
}

#[test]
fn levels_grow_while_the_track_coasts() {
    let flight = Flight::new(no_budget(), &[IntegritySettings::default()]);
    let frames = frames(&flight);
    let mut filter = filter();
    for (frame, seen) in (0..).zip(&frames) {
        flight.take(&mut filter, stamp_ns(frame), seen);
    }
    let mut before = [0.0; 3];
    for later in 0..20 {
        let stamp = stamp_ns(FRAMES - 1 + later);
        if later > 0 {
            let outcome = filter.miss(stamp);
            assert!(
                matches!(outcome, TrackOutcome::Coasting { .. }),
                "{outcome:?}"
            );
        }
        let (followed, transition) = filter.follower(stamp).expect("a track");
        let motion = filter.predict(stamp).expect("a track");
        let levels = flight.monitors[0].judge_track(followed, &transition, &motion);
        let level_m = levels.expect("available").points[1].level_m;
        assert!(
            (0..3).all(|axis| level_m[axis] > before[axis]),
            "{level_m:?}"
        );
        before = level_m;
    }
    assert!(before[1] > 0.3, "{before:?}");
}

#[test]
fn fault_that_hardly_a_frame_shows_is_shown_by_the_track() {
    let settings = IntegritySettings {
        false_alert_probability: 1e-3,
        ..IntegritySettings::default()
    };
    let flight = Flight::new(no_budget(), &[settings]);
    let fault = Fault {
        beacons: 1,
        course: Course::Constant,
        part: 0.6,
    };
    let is_fault =
        |levels: &Result<_, Unavailable>| matches!(levels, Err(Unavailable::Fault { .. }));
    let each = |sums: &mut [f64; 3], moment: &Moment| {
        let levels =
            flight.monitors[0].judge_track(moment.followed, &moment.transition, &moment.motion);
        sums[0] += 1.0;
        sums[1] += f64::from(u8::from(moment.frame.as_ref().is_some_and(is_fault)));
        sums[2] += f64::from(u8::from(is_fault(&levels)));
    };
    let add = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let [frames, of_frames, of_track] = flight.sum(60, SEED, &fault, &[0.0; 3], each, add);
    println!(
        "a fault of 0.6 of the threshold: shown by {:.1} % of frames, by the track in {:.1} %",
        100.0 * of_frames / frames,
        100.0 * of_track / frames
    );
    // Of 2400 frames in 60 approaches.
    assert!(of_frames / frames < 0.1 && of_track / frames > 0.5);
}

/// Mean levels of frames and of the track, for one frame and for an approach of a minute.
#[test]
fn levels_of_the_track_are_no_larger_than_those_of_frames_without_a_budget() {
    for (what, budget) in [
        ("no budget", no_budget()),
        ("budget", example_budget(&support::tanker_markers(6))),
    ] {
        for exposure in [1, 1800] {
            let settings = IntegritySettings {
                frames: exposure,
                ..IntegritySettings::default()
            };
            let flight = Flight::new(budget.clone(), &[settings]);
            // Of frame and track: how many, and sums of three levels and of the lateral error's square.
            let each = |sums: &mut [[f64; 5]; 2], moment: &Moment| {
                let monitor = &flight.monitors[0];
                let track =
                    monitor.judge_track(moment.followed, &moment.transition, &moment.motion);
                for (sum, levels) in sums.iter_mut().zip([moment.frame.as_ref(), Some(&track)]) {
                    if let Some(Ok(levels)) = levels {
                        sum[0] += 1.0;
                        for axis in 0..3 {
                            sum[1 + axis] += levels.points[1].level_m[axis];
                        }
                        sum[4] += error_m(moment, &TAIL).y.powi(2);
                    }
                }
            };
            let add = |a: [[f64; 5]; 2], b: [[f64; 5]; 2]| {
                let plus = |side: usize| std::array::from_fn(|at| a[side][at] + b[side][at]);
                [plus(0), plus(1)]
            };
            let none = [[0.0; 5]; 2];
            let sums = flight.sum(40, SEED + 3, &Fault::NONE, &none, each, add);
            let mean = |side: usize, axis: usize| sums[side][1 + axis] / sums[side][0];
            for (side, name) in ["frame", "track"].into_iter().enumerate() {
                println!(
                    "{what}, {exposure} frames, {name}: ahead {:.3}, lateral {:.3}, vertical {:.3} m ({} of {})",
                    mean(side, 0),
                    mean(side, 1),
                    mean(side, 2),
                    sums[side][0],
                    40 * (FRAMES - 4),
                );
                assert!(sums[side][0] > 0.9 * f64::from(40 * (FRAMES - 4)));
            }
            if what == "no budget" {
                assert!(mean(1, 1) < mean(0, 1));
            }
        }
    }
}
