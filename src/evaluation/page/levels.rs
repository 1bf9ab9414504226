//! Stanford diagrams: protection level against error.

use std::collections::BTreeMap;

use super::chart::{Chart, Layer, Shape, X};
use crate::evaluation::stanford::{Bounded, Diagram};

/// Cells along each axis.
const CELLS: u32 = 60;
/// What the axes are called.
const AXES: [&str; 3] = ["ahead", "lateral", "vertical"];

/// Returns the diagram of a point along an axis.
pub(super) fn chart(diagram: &Diagram) -> Chart {
    let limit = diagram.frames.last().and_then(|frame| frame.limit_m);
    let all = diagram
        .frames
        .iter()
        .flat_map(|frame| [frame.error_m, frame.level_m]);
    let most = 1.06 * all.chain(limit).fold(1e-9, f64::max);
    let mut layers = vec![Layer::new(
        Shape::Polygon(vec![(0.0, 0.0), (most, most), (most, 0.0)]),
        "hazard",
        "misleading: error beyond level",
    )];
    if let Some(limit) = limit {
        layers.push(Layer::new(
            Shape::Boxes(vec![[0.0, most, limit, most]]),
            "idle",
            "unavailable: level beyond limit",
        ));
        layers.push(Layer::new(Shape::Across(limit), "c4", "alert limit"));
        layers.push(Layer::new(Shape::Up(limit), "c4", ""));
    }
    layers.push(Layer::new(
        Shape::Line(vec![(0.0, 0.0), (most, most)]),
        "c7",
        "error = level",
    ));
    layers.push(Layer::new(
        Shape::Shaded(cells(&diagram.frames, most)),
        "c0",
        "frames, darker: more",
    ));
    let axis = AXES[diagram.axis];
    Chart {
        id: format!("stanford-{}-{axis}", diagram.point),
        title: format!("{}, {axis}", diagram.point),
        x_label: "error without its sign, m".to_owned(),
        y_label: "protection level, m".to_owned(),
        x: X::Range((0.0, most)),
        y: (0.0, most),
        is_y_logarithmic: false,
        layers,
    }
}

/// Returns the cells that have frames, with their opacity.
fn cells(frames: &[Bounded], most: f64) -> Vec<([f64; 4], f64)> {
    let size = most / f64::from(CELLS);
    let cell = |value: f64| {
        // Saturates, and is limited to the cells there are.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let index = (value / size) as u32;
        index.min(CELLS - 1)
    };
    let mut counts: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for frame in frames {
        *counts
            .entry((cell(frame.error_m), cell(frame.level_m)))
            .or_default() += 1;
    }
    let fullest = counts.values().copied().max().unwrap_or(1);
    let corner = |index: u32| f64::from(index) * size;
    counts
        .into_iter()
        .map(|((x, y), count)| {
            let share = f64::from(count).ln_1p() / f64::from(fullest).ln_1p();
            let corners = [corner(x), corner(x + 1), corner(y), corner(y + 1)];
            (corners, 0.35 + 0.65 * share)
        })
        .collect()
}
