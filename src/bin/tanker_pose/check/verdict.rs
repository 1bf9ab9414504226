//! "Is this good enough at contact?", and what of the approach needs attention.

use super::along::{Station, overall_weakest};
use super::finding::Finding;
use super::situation::Situation;
use super::view::{AXES, PointView, View, largest};

/// The answer for one declared point.
pub struct Verdict {
    pub point: String,
    pub required_m: f64,
    /// The nearest range with a pose, m.
    pub range_m: f64,
    pub sigma: (usize, f64),
    /// Axis and level, m; `None` without levels.
    pub level: Option<(usize, f64)>,
    /// The cause with the largest share on the worst axis, and its share of the variance.
    pub dominant: Option<(String, f64)>,
    /// What has the largest part in the worst level; `None`: noise and budget alone.
    pub weakest: Option<String>,
    /// Why there is no level.
    pub no_level: Option<String>,
}

impl Verdict {
    fn new(name: &str, required_m: f64, range_m: f64, view: &View, point: &PointView) -> Self {
        let sigma = largest(&point.sigma_m);
        let level = point.level_m.map(|level_m| largest(&level_m));
        let total: f64 = point
            .shares
            .iter()
            .map(|share| share.variance_m2[sigma.0])
            .sum();
        let dominant = point
            .shares
            .iter()
            .max_by(|a, b| a.variance_m2[sigma.0].total_cmp(&b.variance_m2[sigma.0]))
            .filter(|_| total > 0.0)
            .map(|share| (share.cause.clone(), share.variance_m2[sigma.0] / total));
        Self {
            point: name.to_owned(),
            required_m,
            range_m,
            sigma,
            level,
            dominant,
            weakest: level.and_then(|(axis, _)| point.weakest[axis].clone()),
            no_level: view.no_level.clone(),
        }
    }

    pub fn is_good(&self) -> bool {
        self.level
            .is_some_and(|(_, level_m)| level_m <= self.required_m)
    }

    /// Returns the answer in words.
    pub fn in_words(&self) -> String {
        let cm = |m: f64| format!("{:.1} cm", 100.0 * m);
        let (axis, sigma_m) = self.sigma;
        let because = self
            .dominant
            .as_ref()
            .map_or_else(String::new, |(cause, share)| {
                format!(", {:.0} % of its variance from {cause}", 100.0 * share)
            });
        let level = match (&self.level, &self.no_level) {
            (Some((axis, level_m)), _) => {
                let weakest = self.weakest.as_ref().map_or_else(
                    || " (no fault matters)".to_owned(),
                    |weakest| format!(" (mostly because {weakest} may be faulty)"),
                );
                format!("protection level {} {}{weakest}", cm(*level_m), AXES[*axis])
            }
            (None, Some(reason)) => format!("no protection level: {reason}"),
            (None, None) => "no protection level".to_owned(),
        };
        let answer = if self.is_good() {
            "yes"
        } else if sigma_m > self.required_m {
            "no, not even without a fault"
        } else if self.level.is_some() {
            "no, only while nothing is faulty"
        } else {
            "not shown"
        };
        format!(
            "{}: good enough for {} at {:.1} m? {answer}: sigma {} {}{because}; {level}",
            self.point,
            cm(self.required_m),
            self.range_m,
            cm(sigma_m),
            AXES[axis],
        )
    }

    fn advice(&self) -> String {
        let improve = |cause: &str| match cause {
            "noise" | "correlated_noise" => {
                "a better detector, a longer lens or beacons farther apart".to_owned()
            }
            "survey" => "a better survey of the markers".to_owned(),
            "mount" => "a better measured mount of the camera".to_owned(),
            "point" => "a better known place of the point".to_owned(),
            "attitude" => "a better known attitude".to_owned(),
            "jitter_u" | "jitter_v" => "less jitter of the image".to_owned(),
            other => format!("a smaller error of {other}"),
        };
        match (&self.weakest, &self.dominant) {
            _ if self.level.is_none() && self.sigma.1 <= self.required_m => {
                "first: more beacons in the image at this range".to_owned()
            }
            (Some(weakest), _) if self.sigma.1 <= self.required_m => {
                format!("first: more beacons, so that {weakest} can be missed")
            }
            (_, Some((cause, _))) => format!("first: {}", improve(cause)),
            _ => "add beacons".to_owned(),
        }
    }
}

/// Returns the answer for each declared point, at the nearest range with a pose.
pub fn verdicts(situation: &Situation, stations: &[Station], required_m: f64) -> Vec<Verdict> {
    let nearest = stations
        .iter()
        .rev()
        .find_map(|station| Some((station.range_m, station.view.as_ref().ok()?)));
    let Some((range_m, view)) = nearest else {
        return Vec::new();
    };
    let points = situation.monitor.points().iter().zip(&view.points);
    points
        .map(|(declared, point)| Verdict::new(&declared.name, required_m, range_m, view, point))
        .collect()
}

/// Returns the findings along the approach.
pub fn findings(situation: &Situation, stations: &[Station], verdicts: &[Verdict]) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(refused(stations));
    findings.extend(leaving(stations));
    findings.extend(ambiguous(situation, stations));
    findings.extend(without_level(stations));
    findings.extend(weakest(stations));
    for verdict in verdicts.iter().filter(|verdict| !verdict.is_good()) {
        findings.push(Finding::warning(
            "required",
            verdict.in_words(),
            verdict.advice(),
        ));
    }
    findings
}

fn refused(stations: &[Station]) -> Option<Finding> {
    let refused: Vec<(f64, &String)> = stations
        .iter()
        .filter_map(|station| Some((station.range_m, station.view.as_ref().err()?)))
        .collect();
    let (last_m, reason) = *refused.last()?;
    let found = format!(
        "no pose at {}: {reason}",
        ranges(refused.iter().map(|(range_m, _)| *range_m), stations)
    );
    Some(if refused.len() == stations.len() {
        let advice = "the node would refuse every frame of this approach";
        Finding::error("no_pose", found, advice)
    } else {
        let advice =
            format!("a wider lens, or beacons that stay in the image down to {last_m:.1} m");
        Finding::warning("no_pose", found, advice)
    })
}

/// Returns some of the ranges in words; descending.
fn ranges(some: impl Iterator<Item = f64>, stations: &[Station]) -> String {
    let some: Vec<f64> = some.collect();
    match (some.first(), some.last()) {
        (Some(first_m), Some(last_m)) if some.len() > 1 => format!(
            "{} of {} ranges, {first_m:.1} m to {last_m:.1} m",
            some.len(),
            stations.len()
        ),
        (Some(only_m), _) => format!("{only_m:.1} m"),
        _ => "no range".to_owned(),
    }
}

/// The markers that are not in the image, with the range from which on.
fn leaving(stations: &[Station]) -> Option<Finding> {
    let last = stations.last()?;
    if last.lost.is_empty() {
        return None;
    }
    let since = |id: u32| {
        let kept = stations
            .iter()
            .rev()
            .take_while(|station| station.lost.contains(&id));
        kept.last().map_or(last.range_m, |station| station.range_m)
    };
    let mut words: Vec<(f64, u32)> = last.lost.iter().map(|&id| (since(id), id)).collect();
    words.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let words: Vec<String> = words
        .iter()
        .map(|(range_m, id)| format!("{id} from {range_m:.1} m on"))
        .collect();
    Some(Finding::note(
        "leave_image",
        format!("markers leave the image: {}", words.join(", ")),
        "a wider lens keeps them, at the price of accuracy far away",
    ))
}

fn ambiguous(situation: &Situation, stations: &[Station]) -> Option<Finding> {
    let limit = situation.estimator.settings().max_ambiguity;
    let views = stations
        .iter()
        .filter_map(|station| Some((station.range_m, station.view.as_ref().ok()?.ambiguity)));
    // The integrity risk of a second pose counts long before a frame is refused for it.
    let (range_m, ambiguity) = views.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (ambiguity > situation.monitor.settings().hmi_probability).then(|| {
        Finding::warning(
            "second_pose",
            format!(
                "a second pose is up to {ambiguity:.1e} times as likely as the right one, worst at {range_m:.1} m; \
                 frames are refused from {limit} on, and protection levels end earlier"
            ),
            "spread the beacons in depth",
        )
    })
}

fn without_level(stations: &[Station]) -> Option<Finding> {
    let without: Vec<(f64, &String)> = stations
        .iter()
        .filter_map(|station| {
            let reason = station.view.as_ref().ok()?.no_level.as_ref()?;
            Some((station.range_m, reason))
        })
        .collect();
    let (_, reason) = without.last()?;
    Some(Finding::warning(
        "no_level",
        format!(
            "no protection level at {}: {reason}",
            ranges(without.iter().map(|(range_m, _)| *range_m), stations)
        ),
        "keep more beacons in the image there: two are suspected at once, and four must remain",
    ))
}

/// The beacon that is the weakest at most ranges.
fn weakest(stations: &[Station]) -> Option<Finding> {
    let name = overall_weakest(stations)?;
    let station = (stations.iter().rev()).find(|station| {
        station
            .view
            .as_ref()
            .is_ok_and(|view| view.no_level.is_none())
    })?;
    let with_all = station.view.as_ref().ok()?.worst_level_m();
    let mut without = station.without.iter();
    let without = without
        .find(|without| without.beacon == name)?
        .worst_level_m();
    let none = (station.without.iter()).filter(|without| without.worst_level_m().is_infinite());
    let found = match none.count() {
        0 => format!(
            "the weakest beacon is {name}: without it the worst level is {without:.3} m instead of {with_all:.3} m at \
             {:.1} m",
            station.range_m
        ),
        count => format!(
            "at {:.1} m there is no level any more when one of {count} beacons is lost; the weakest is {name}",
            station.range_m
        ),
    };
    Some(Finding::note(
        "weakest",
        found,
        "a second beacon near it would help most against its loss",
    ))
}
