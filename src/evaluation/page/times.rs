//! Charts of stamps and delays.

use super::chart::{Chart, Layer, Shape, X};
use super::errors::{largest, range};
use crate::evaluation::Evaluation;
use crate::evaluation::consistency::seconds;
use crate::evaluation::gather::Times;
use crate::evaluation::timing::offset_s;
use crate::evaluation::topics::Role;

/// Returns the distance of each stamp from the one before, of the topic that shows the camera's own pace.
pub(super) fn steps(evaluation: &Evaluation) -> Option<Chart> {
    let (role, times) = paced(evaluation)?;
    let points: Vec<(f64, f64)> = times
        .windows(2)
        .map(|pair| {
            let step_ms = 1e3 * seconds(pair[1].stamp_ns - pair[0].stamp_ns);
            (evaluation.time_s(pair[1].stamp_ns), step_ms)
        })
        .collect();
    let (low, high) = range(points.iter().map(|point| point.1));
    let room = (0.05 * (high - low)).max(0.02 * high.abs());
    (!points.is_empty()).then(|| Chart {
        id: "stamp-steps".to_owned(),
        title: format!("Time between images, by the stamps of {}", role.label()),
        x_label: "time since the start, s".to_owned(),
        y_label: "from the stamp before, ms".to_owned(),
        x: X::Range(range(points.iter().map(|point| point.0))),
        y: (low.min(0.0), high + room),
        is_y_logarithmic: false,
        layers: vec![Layer::new(Shape::Dots(points), "c0 small", "an image")],
    })
}

/// Returns log time minus stamp of detections and statuses over time; `None` where every log time is the stamp.
pub(super) fn delays(evaluation: &Evaluation) -> Option<Chart> {
    let mut layers = Vec::new();
    let mut all: Vec<(f64, f64)> = Vec::new();
    let shown = [
        (Role::Detections, "c0 small"),
        (Role::Status, "c1 small"),
        (Role::Pose, "c2 small"),
    ];
    for (role, class) in shown {
        let Some(heard) = evaluation.gathered.heard.get(&role) else {
            continue;
        };
        let points: Vec<(f64, f64)> = heard
            .times
            .iter()
            .filter(|time| time.stamp_ns > 0)
            .map(|time| (evaluation.time_s(time.stamp_ns), 1e3 * offset_s(time)))
            .collect();
        all.extend(&points);
        layers.push(Layer::new(Shape::Dots(points), class, role.label()));
    }
    let (low, high) = range(all.iter().map(|point| point.1));
    let most = largest([low, high].into_iter());
    (most > 0.0).then(|| Chart {
        id: "log-minus-stamp".to_owned(),
        title: "Log time minus stamp".to_owned(),
        x_label: "time since the start, s".to_owned(),
        y_label: "log time − stamp, ms".to_owned(),
        x: X::Range(range(all.iter().map(|point| point.0))),
        y: (low.min(0.0), high.max(0.0) + 0.05 * (high - low).max(1e-3)),
        is_y_logarithmic: false,
        layers,
    })
}

/// Returns the first of the topics that every image has a message on.
fn paced(evaluation: &Evaluation) -> Option<(Role, Vec<Times>)> {
    let roles = [Role::Detections, Role::Status, Role::Pose];
    roles.into_iter().find_map(|role| {
        let heard = evaluation.gathered.heard.get(&role)?;
        let times = heard.times.iter().copied();
        Some((role, times.filter(|time| time.stamp_ns > 0).collect()))
    })
}
