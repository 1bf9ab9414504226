//! Markers that every pose leaves out: not a wrong detection now and then, but a wrong place in the map, or a detector
//! that takes something else for them.

use std::time::{Duration, Instant};

/// How long a marker must have been left out without a pose that rests on it.
const LASTING: Duration = Duration::from_secs(3);
/// Of how many poses.
const MANY: u32 = 10;

/// Markers that the last poses left out.
#[derive(Debug, Default)]
pub struct Suspects {
    runs: Vec<Run>,
}

/// Poses in a row that left a marker out; those that did not see it do not count.
#[derive(Debug)]
struct Run {
    id: u32,
    since: Instant,
    poses: u32,
}

impl Suspects {
    /// Takes note of a pose that leaves a marker out; says so when that is so for long.
    pub fn left_out(&mut self, id: u32, now: Instant) -> Option<String> {
        let known = self.runs.iter().position(|run| run.id == id);
        let index = known.unwrap_or_else(|| {
            self.runs.push(Run {
                id,
                since: now,
                poses: 0,
            });
            self.runs.len() - 1
        });
        let run = &mut self.runs[index];
        run.poses = run.poses.saturating_add(1);
        let lasted = now.saturating_duration_since(run.since);
        (lasted >= LASTING && run.poses >= MANY).then(|| {
            format!(
                "marker {id} was left out of all {} poses of {:.0} s: its place in the marker map is wrong, or the \
                 detector takes something else for it",
                run.poses,
                lasted.as_secs_f64()
            )
        })
    }

    /// Takes note of a pose that rests on a marker; returns whether it was left out before.
    pub fn used(&mut self, id: u32) -> bool {
        let known = self.runs.iter().position(|run| run.id == id);
        if let Some(index) = known {
            self.runs.swap_remove(index);
        }
        known.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Duration = Duration::from_millis(100);

    #[test]
    fn marker_that_every_pose_leaves_out_is_named_after_three_seconds() {
        let (mut suspects, start) = (Suspects::default(), Instant::now());
        for frame in 0..30 {
            assert_eq!(suspects.left_out(6, start + frame * FRAME), None, "{frame}");
        }
        let words = suspects.left_out(6, start + 30 * FRAME).expect("3 s");
        assert!(
            words.starts_with("marker 6 was left out of all 31 poses of 3 s"),
            "{words}"
        );
        assert!(suspects.used(6));
        assert!(!suspects.used(6));
        assert_eq!(suspects.left_out(6, start + 31 * FRAME), None, "begun anew");
    }

    #[test]
    fn few_poses_and_markers_that_are_used_in_between_are_no_matter() {
        let (mut suspects, start) = (Suspects::default(), Instant::now());
        for second in 0..9 {
            assert_eq!(suspects.left_out(1, start + second * 10 * FRAME), None);
        }
        for frame in 0..1000 {
            assert_eq!(suspects.left_out(2, start + frame * FRAME), None);
            if frame % 20 == 19 {
                suspects.used(2);
            }
        }
    }
}
