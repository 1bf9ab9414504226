//! What was heard, in words: the pieces of which the table and the lines are made.

use std::time::{Duration, Instant};

use tanker_pose::pipeline::{OutcomeCode, TrackCode};
use tanker_pose::ros::messages::EstimatorStatus;

use super::heard::{Counts, Heard, RECENT, REPORT_EVERY, outcome_name};

/// Characters of a message that are shown; the node's own are far shorter.
const SHOWN: usize = 500;
/// Ids that are listed; a frame of tags may hold hundreds.
const LISTED: usize = 16;

/// How a piece of text is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Something is missing or wrong.
    Bad,
    /// Neither.
    Plain,
}

/// What can be said of a node at one moment.
#[derive(Debug)]
pub struct Scene<'a> {
    /// What was heard of it.
    pub heard: &'a Heard,
    /// Why no node is watched, if so.
    pub missing: Option<String>,
    /// Processes that say they are this node; one, if all is well.
    pub processes: usize,
    /// When.
    pub now: Instant,
}

impl Scene<'_> {
    /// Returns the latest outcome with its reason, or what there is instead of outcomes.
    pub fn state(&self) -> (Tone, String) {
        if let Some(missing) = &self.missing {
            return (Tone::Bad, missing.clone());
        }
        if let Some(status) = self.heard.status(self.now) {
            let name = outcome_name(status.outcome);
            return if status.outcome == OutcomeCode::Ok.number() {
                (Tone::Good, name)
            } else {
                (Tone::Bad, format!("{name}: {}", plain(&status.message)))
            };
        }
        let silence = self.heard.silence(self.now);
        let listened = self.heard.listened(self.now);
        if silence.is_none() && listened < RECENT {
            return (Tone::Plain, "waiting for its frames".to_owned());
        }
        let why = match self.heard.estimation_since_last_frame(self.now) {
            Some(report) => plain(&report.message),
            None if silence.unwrap_or(listened) < REPORT_EVERY => {
                "no report about it on /diagnostics yet".to_owned()
            }
            None => {
                "no report on /diagnostics either: it hangs, or was suspended or killed".to_owned()
            }
        };
        let silent = age(silence.unwrap_or(listened));
        (
            Tone::Bad,
            format!("the node has answered no frame for {silent}: {why}"),
        )
    }

    /// Returns the age of the latest pose, or a note that there was none.
    pub fn pose_age(&self) -> String {
        match self.heard.pose(self.now) {
            None => "no pose yet".to_owned(),
            Some((_, passed)) if passed > RECENT => format!("no pose for {}", age(passed)),
            Some((_, passed)) => format!("age {}", age(passed)),
        }
    }

    /// Returns what the fit rests on.
    pub fn points(&self) -> Option<String> {
        let status = self.heard.status(self.now)?;
        let used = status.used_ids.len();
        let left_out = match status.rejected_ids.as_slice() {
            [] => "0".to_owned(),
            ids => list(ids),
        };
        Some(format!("used {used}, left out {left_out}"))
    }

    /// Returns how well the fit explains the pixels.
    pub fn fit(&self) -> Option<String> {
        let status = self.heard.status(self.now)?;
        Some(format!(
            "chi2/dof {}, rms {} px, ambiguity {}{}",
            chi_squared_per_degree(status),
            number(status.rms_residual),
            number(status.ambiguity),
            certificate(status)
        ))
    }

    /// Returns what became of the track.
    pub fn track(&self) -> Option<String> {
        let status = self.heard.status(self.now)?;
        let code = TrackCode::ALL
            .iter()
            .find(|code| code.number() == status.track)
            .map_or_else(|| status.track.to_string(), |code| code.name().to_owned());
        Some(code)
    }

    /// Returns the frames of the last second by outcome, and the markers that were left out in it.
    pub fn last_second(&self) -> String {
        let Counts {
            frames,
            outcomes,
            left_out,
        } = self.heard.counts(self.now);
        if frames == 0 {
            return frame_count(0);
        }
        let outcomes: Vec<String> = outcomes
            .iter()
            .map(|(outcome, n)| format!("{n} {}", outcome_name(*outcome)))
            .collect();
        let left_out: Vec<String> = left_out
            .iter()
            .take(LISTED)
            .map(|(id, n)| format!("{id} in {n}"))
            .collect();
        let left_out = match left_out.as_slice() {
            [] => String::new(),
            some => format!(", left out: marker {}", some.join(", ")),
        };
        format!("{}: {}{left_out}", frame_count(frames), outcomes.join(", "))
    }

    /// Returns the faults with their keys.
    pub fn faults(&self) -> (Tone, Vec<String>) {
        let mut all: Vec<String> = match self.heard.faults(self.now) {
            None => {
                return (
                    Tone::Plain,
                    vec!["unknown: no report on /diagnostics".to_owned()],
                );
            }
            Some(faults) => faults
                .iter()
                .map(|(key, words)| format!("{}: {}", plain(key), plain(words)))
                .collect(),
        };
        if self.processes > 1 {
            all.push(format!(
                "{} processes claim to be this node: their messages are mixed here \
                 (one that was killed counts for some time more)",
                self.processes
            ));
        }
        if all.is_empty() {
            (Tone::Good, vec!["none".to_owned()])
        } else {
            (Tone::Bad, all)
        }
    }

    /// Returns a value of the report on the estimation.
    pub fn reported(&self, key: &str) -> Option<String> {
        let report = self.heard.estimation(self.now)?;
        let pair = report.values.iter().find(|pair| pair.key == key)?;
        (!pair.value.is_empty()).then(|| plain(&pair.value))
    }
}

fn frame_count(frames: usize) -> String {
    format!("{frames} frame{}", if frames == 1 { "" } else { "s" })
}

fn chi_squared_per_degree(status: &EstimatorStatus) -> String {
    match status.degrees_of_freedom {
        0 => "-".to_owned(),
        degrees => number(status.chi_squared / f64::from(degrees)),
    }
}

/// Returns the number, or a dash for one that there is not.
fn number(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.2}")
    } else {
        "-".to_owned()
    }
}

/// Returns a time that has passed, in digits that are worth reading.
pub fn age(passed: Duration) -> String {
    let s = passed.as_secs_f64();
    if s < 10.0 {
        format!("{s:.2} s")
    } else {
        format!("{s:.0} s")
    }
}

/// Returns ids, the first ones of many.
pub fn list(ids: &[u32]) -> String {
    let shown: Vec<String> = ids.iter().take(LISTED).map(u32::to_string).collect();
    let more = if ids.len() > LISTED { " …" } else { "" };
    format!("{}{more}", shown.join(" "))
}

/// Returns foreign text without what could move a terminal's cursor, cut where it is longer than a message.
pub fn plain(text: &str) -> String {
    let mut shown: String = text
        .chars()
        .take(SHOWN)
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    if text.chars().nth(SHOWN).is_some() {
        shown.push('…');
    }
    shown
}

/// Returns what is known of other minima; nothing where no proof was asked for.
fn certificate(status: &EstimatorStatus) -> &'static str {
    match status.certificate {
        EstimatorStatus::CERTIFICATE_CERTIFIED => ", certified",
        EstimatorStatus::CERTIFICATE_NOT_CERTIFIED => ", not certified",
        EstimatorStatus::CERTIFICATE_REPLACED => ", certified, false start replaced",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_that_was_listened_to_for_a_moment_is_not_called_silent() {
        let since = Instant::now();
        let heard = Heard::new(since);
        let state = |milliseconds| {
            let scene = Scene {
                heard: &heard,
                missing: None,
                processes: 1,
                now: since + Duration::from_millis(milliseconds),
            };
            scene.state()
        };
        for milliseconds in [0, 500] {
            let expected = (Tone::Plain, "waiting for its frames".to_owned());
            assert_eq!(state(milliseconds), expected);
        }
        let (tone, words) = state(1500);
        assert_eq!(tone, Tone::Bad);
        assert!(
            words.starts_with("the node has answered no frame for 1"),
            "{words}"
        );
    }

    #[test]
    fn foreign_text_moves_no_cursor_and_stays_short() {
        assert_eq!(
            plain("frame \"camera\", 3.0 ± 1"),
            "frame \"camera\", 3.0 ± 1"
        );
        assert_eq!(plain("a\u{1b}[2Jb\nc"), "a [2Jb c");
        assert_eq!(plain(&"x".repeat(1_000_000)).chars().count(), SHOWN + 1);
    }

    #[test]
    fn numbers_that_there_are_not_are_dashes() {
        let status = EstimatorStatus {
            chi_squared: f64::NAN,
            degrees_of_freedom: 6,
            ..EstimatorStatus::default()
        };
        assert_eq!(chi_squared_per_degree(&status), "-");
        let status = EstimatorStatus {
            chi_squared: 3.0,
            degrees_of_freedom: 0,
            ..status
        };
        assert_eq!(chi_squared_per_degree(&status), "-");
        let status = EstimatorStatus {
            degrees_of_freedom: 6,
            ..status
        };
        assert_eq!(chi_squared_per_degree(&status), "0.50");
    }

    #[test]
    fn many_ids_are_shortened() {
        assert_eq!(list(&[5, 7]), "5 7");
        let many: Vec<u32> = (0..100).collect();
        assert!(list(&many).ends_with("15 …"), "{}", list(&many));
    }
}
