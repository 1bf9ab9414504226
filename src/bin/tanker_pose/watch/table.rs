//! A moment as rows of a table, and as one line.

use super::heard::RECENT;
use super::reading::Reading;
use super::words::{Scene, Tone};

/// One row: what, and its value, which may be wrapped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// What it is about; empty where it goes on.
    pub label: &'static str,
    /// In words.
    pub text: String,
    /// How it is meant.
    pub tone: Tone,
}

impl Row {
    fn plain(label: &'static str, text: String) -> Self {
        Self {
            label,
            text,
            tone: Tone::Plain,
        }
    }
}

/// Returns the rows of the table, whose number changes with the faults alone.
pub fn rows(scene: &Scene) -> Vec<Row> {
    let (tone, state) = scene.state();
    // An older pose is not shown: it could be taken for the present one.
    let reading = scene
        .heard
        .pose(scene.now)
        .filter(|(_, age)| *age <= RECENT)
        .map(|(reading, _)| reading);
    let of = |pick: fn(&Reading) -> [f64; 3]| reading.map(pick);
    let mut rows = vec![
        Row {
            label: "outcome",
            text: state,
            tone,
        },
        Row::plain("last second", scene.last_second()),
        Row::plain("", format!("{:>10}{:>11}{:>11}", "right", "down", "ahead")),
        Row {
            label: "position",
            text: format!(
                "{} m    {}",
                three(of(|r| r.position_m), 3),
                scene.pose_age()
            ),
            tone: if reading.is_some() {
                Tone::Plain
            } else {
                Tone::Bad
            },
        },
        Row::plain(
            "  sigma",
            format!("{} m", three(of(|r| r.position_sigma_m), 3)),
        ),
        Row::plain(
            "velocity",
            format!(
                "{} m/s",
                three(scene.heard.velocity_mps(scene.now).copied(), 3)
            ),
        ),
        Row::plain("", format!("{:>10}{:>11}{:>11}", "roll", "pitch", "yaw")),
        Row::plain(
            "attitude",
            format!("{} deg", three(of(|r| r.attitude_deg), 2)),
        ),
        Row::plain(
            "  sigma",
            format!("{} deg", three(of(|r| r.attitude_sigma_deg), 2)),
        ),
        Row::plain("points", or_dash(scene.points())),
        Row::plain("fit", or_dash(scene.fit())),
        Row::plain("track", or_dash(scene.track())),
        Row::plain("camera", or_dash(scene.reported("camera_info"))),
        Row::plain("timing", timing(scene)),
    ];
    let (tone, faults) = scene.faults();
    let labels = std::iter::once("faults").chain(std::iter::repeat(""));
    rows.extend(
        faults
            .into_iter()
            .zip(labels)
            .map(|(text, label)| Row { label, text, tone }),
    );
    rows
}

/// Returns the same as one line.
pub fn line(scene: &Scene) -> String {
    let mut parts = vec![scene.state().1];
    match scene.heard.pose(scene.now) {
        Some((reading, age)) if age <= RECENT => parts.push(pose(reading)),
        _ => {}
    }
    parts.push(scene.pose_age());
    if scene.missing.is_none() {
        parts.extend(scene.points());
        parts.extend(scene.fit());
        parts.extend(scene.track().map(|track| format!("track {track}")));
        parts.push(scene.last_second());
        parts.push(format!("faults: {}", scene.faults().1.join("; ")));
    }
    parts.join(" | ")
}

fn pose(reading: &Reading) -> String {
    let [right, down, ahead] = reading.position_m;
    let [sigma_right, sigma_down, sigma_ahead] = reading.position_sigma_m;
    let [roll, pitch, yaw] = reading.attitude_deg;
    let [sigma_roll, sigma_pitch, sigma_yaw] = reading.attitude_sigma_deg;
    format!(
        "right {right:.3} ±{sigma_right:.3}, down {down:.3} ±{sigma_down:.3}, ahead {ahead:.3} ±{sigma_ahead:.3} m | \
         roll {roll:.2} ±{sigma_roll:.2}, pitch {pitch:.2} ±{sigma_pitch:.2}, yaw {yaw:.2} ±{sigma_yaw:.2} deg"
    )
}

fn three(values: Option<[f64; 3]>, digits: usize) -> String {
    let cell = |axis: usize| {
        values.map_or_else(
            || "-".to_owned(),
            |values| format!("{:.digits$}", values[axis]),
        )
    };
    format!("{:>10}{:>11}{:>11}", cell(0), cell(1), cell(2))
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "-".to_owned())
}

fn timing(scene: &Scene) -> String {
    let ms = |key: &str| {
        scene
            .reported(key)
            .map_or_else(|| "-".to_owned(), |ms| format!("{ms} ms"))
    };
    format!(
        "image to pose {}, of that in the node {} (medians)",
        ms("image_age_p50_ms"),
        ms("latency_p50_ms")
    )
}
