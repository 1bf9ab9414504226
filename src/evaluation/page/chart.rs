//! Charts as SVG, with a legend in HTML: no script, no font, nothing from elsewhere.

use std::fmt::Write;

use maud::{Markup, PreEscaped, html};

use super::scale::Scale;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 46.0;
/// More points than this are drawn as the least and the largest of as many intervals.
const COLUMNS: usize = 600;

/// A chart.
pub(super) struct Chart {
    /// Identifies it on the page.
    pub(super) id: String,
    pub(super) title: String,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) x: X,
    pub(super) y: (f64, f64),
    pub(super) is_y_logarithmic: bool,
    pub(super) layers: Vec<Layer>,
}

/// The horizontal axis.
pub(super) enum X {
    /// From the first to the second.
    Range((f64, f64)),
    /// Names at 1, 2 and so on.
    Names(Vec<String>),
}

/// What is drawn, the first below the others.
pub(super) struct Layer {
    pub(super) shape: Shape,
    /// A class of the style sheet, `c0` to `c7`, or of its own.
    pub(super) class: String,
    /// In the legend; empty: not there.
    pub(super) name: String,
}

/// Forms of a layer, in the units of the axes.
pub(super) enum Shape {
    /// Points joined in their order.
    Line(Vec<(f64, f64)>),
    /// As a line, interrupted where the break of x is larger than this.
    Broken(Vec<(f64, f64)>, f64),
    /// Points alone.
    Dots(Vec<(f64, f64)>),
    /// From x to x and y to y.
    Boxes(Vec<[f64; 4]>),
    /// Boxes whose last number is their opacity, 0 to 1.
    Shaded(Vec<([f64; 4], f64)>),
    /// x, then low and high y.
    Whiskers(Vec<(f64, f64, f64)>),
    /// A closed outline.
    Polygon(Vec<(f64, f64)>),
    /// A line across at a height.
    Across(f64),
    /// A line up at a place.
    Up(f64),
}

impl Layer {
    pub(super) fn new(shape: Shape, class: &str, name: &str) -> Self {
        Self {
            shape,
            class: class.to_owned(),
            name: name.to_owned(),
        }
    }
}

impl Chart {
    /// Returns the chart as HTML.
    pub(super) fn markup(&self) -> Markup {
        html! {
            figure data-plot=(self.id) {
                figcaption { (self.title) }
                @if self.layers.iter().any(|layer| !layer.name.is_empty()) {
                    ul.legend {
                        @for layer in self.layers.iter().filter(|layer| !layer.name.is_empty()) {
                            li { span class={ "key " (layer.key()) " " (layer.class) } {} (layer.name) }
                        }
                    }
                }
                (PreEscaped(self.svg()))
            }
        }
    }

    fn svg(&self) -> String {
        let x = match &self.x {
            X::Range((low, high)) => Scale::linear(*low, *high, LEFT, WIDTH - RIGHT),
            X::Names(names) => Scale::named(names, LEFT, WIDTH - RIGHT),
        };
        let (floor, ceiling) = (HEIGHT - BOTTOM, TOP);
        let y = if self.is_y_logarithmic {
            Scale::logarithmic(self.y.0, self.y.1, floor, ceiling)
        } else {
            Scale::linear(self.y.0, self.y.1, floor, ceiling)
        };
        let label = escaped(&self.title);
        let mut svg =
            format!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{label}\">");
        for (place, label) in x.ticks() {
            let label = escaped(label);
            push(
                &mut svg,
                format_args!(
                    "<path class=\"grid\" d=\"M{place:.1} {ceiling}V{floor}\"/><text class=\"tick\" x=\"{place:.1}\" y=\"{:.1}\" \
                     text-anchor=\"middle\">{label}</text>",
                    floor + 17.0
                ),
            );
        }
        for (place, label) in y.ticks() {
            push(
                &mut svg,
                format_args!(
                    "<path class=\"grid\" d=\"M{LEFT} {place:.1}H{:.1}\"/><text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" \
                     text-anchor=\"end\">{label}</text>",
                    WIDTH - RIGHT,
                    LEFT - 7.0,
                    place + 4.0
                ),
            );
        }
        for layer in &self.layers {
            layer.draw(&mut svg, &x, &y);
        }
        push(
            &mut svg,
            format_args!(
                "<path class=\"axis\" d=\"M{LEFT} {ceiling}V{floor}H{:.1}\"/><text class=\"label\" x=\"{:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\">{}</text><text class=\"label\" transform=\"translate(14 {:.1}) rotate(-90)\" \
                 text-anchor=\"middle\">{}</text></svg>",
                WIDTH - RIGHT,
                0.5 * (LEFT + WIDTH - RIGHT),
                HEIGHT - 8.0,
                escaped(&self.x_label),
                0.5 * (ceiling + floor),
                escaped(&self.y_label)
            ),
        );
        svg
    }
}

impl Layer {
    /// Returns how the legend shows it.
    const fn key(&self) -> &'static str {
        match self.shape {
            Shape::Line(_)
            | Shape::Broken(..)
            | Shape::Across(_)
            | Shape::Up(_)
            | Shape::Whiskers(_) => "stroke",
            Shape::Dots(_) => "dot",
            Shape::Boxes(_) | Shape::Shaded(_) | Shape::Polygon(_) => "fill",
        }
    }

    fn draw(&self, svg: &mut String, x: &Scale, y: &Scale) {
        let class = &self.class;
        let path = |svg: &mut String, kind: &str, d: &str| {
            push(
                svg,
                format_args!("<path class=\"{kind} {class}\" d=\"{d}\"/>"),
            );
        };
        let place = |at: &(f64, f64)| Some((x.place(at.0)?, y.place(at.1)?));
        match &self.shape {
            Shape::Line(points) => path(svg, "line", &joined(points, f64::INFINITY, place)),
            Shape::Broken(points, gap) => path(svg, "line", &joined(points, *gap, place)),
            Shape::Polygon(points) => {
                path(svg, "area", &(joined(points, f64::INFINITY, place) + "Z"));
            }
            Shape::Dots(points) => {
                let mut d = String::new();
                for (px, py) in thinned(points).iter().filter_map(place) {
                    push(&mut d, format_args!("M{px:.1} {py:.1}h0"));
                }
                path(svg, "dots", &d);
            }
            Shape::Boxes(boxes) => {
                let mut d = String::new();
                for corners in boxes {
                    rectangle(&mut d, corners, x, y);
                }
                path(svg, "area", &d);
            }
            Shape::Shaded(boxes) => {
                for (corners, opacity) in boxes {
                    let mut d = String::new();
                    rectangle(&mut d, corners, x, y);
                    push(
                        svg,
                        format_args!(
                            "<path class=\"area {class}\" fill-opacity=\"{opacity:.2}\" d=\"{d}\"/>"
                        ),
                    );
                }
            }
            Shape::Whiskers(bars) => {
                let mut d = String::new();
                for &(at, low, high) in bars {
                    if let (Some(px), Some(low), Some(high)) =
                        (x.place(at), y.place(low), y.place(high))
                    {
                        push(
                            &mut d,
                            format_args!(
                                "M{px:.1} {low:.1}V{high:.1}M{0:.1} {low:.1}h8M{0:.1} {high:.1}h8",
                                px - 4.0
                            ),
                        );
                    }
                }
                path(svg, "line", &d);
            }
            Shape::Across(height) => {
                if let Some(py) = y.place(*height) {
                    path(
                        svg,
                        "line",
                        &format!("M{LEFT} {py:.1}H{:.1}", WIDTH - RIGHT),
                    );
                }
            }
            Shape::Up(at) => {
                if let Some(px) = x.place(*at) {
                    path(
                        svg,
                        "line",
                        &format!("M{px:.1} {TOP}V{:.1}", HEIGHT - BOTTOM),
                    );
                }
            }
        }
    }
}

fn joined(
    points: &[(f64, f64)],
    gap: f64,
    place: impl Fn(&(f64, f64)) -> Option<(f64, f64)>,
) -> String {
    let mut d = String::new();
    let mut before: Option<f64> = None;
    for point in &thinned(points) {
        let Some((px, py)) = place(point) else {
            before = None;
            continue;
        };
        let joins = before.is_some_and(|before| point.0 - before <= gap);
        push(
            &mut d,
            format_args!("{}{px:.1} {py:.1}", if joins { 'L' } else { 'M' }),
        );
        before = Some(point.0);
    }
    d
}

/// Returns the points, or of very many the least and the largest of equal numbers of neighbours.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= 2 * COLUMNS {
        return points.to_vec();
    }
    points
        .chunks(points.len().div_ceil(COLUMNS))
        .flat_map(|chunk| {
            let least = chunk.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let largest = chunk.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            let mut both: Vec<(f64, f64)> = least.into_iter().chain(largest).copied().collect();
            both.sort_by(|a, b| a.0.total_cmp(&b.0));
            both
        })
        .collect()
}

fn rectangle(d: &mut String, &[x0, x1, y0, y1]: &[f64; 4], x: &Scale, y: &Scale) {
    let places = (x.place(x0), x.place(x1), y.place(y0), y.place(y1));
    if let (Some(x0), Some(x1), Some(y0), Some(y1)) = places {
        push(d, format_args!("M{x0:.1} {y0:.1}H{x1:.1}V{y1:.1}H{x0:.1}Z"));
    }
}

fn push(text: &mut String, words: std::fmt::Arguments) {
    // Writing into a string cannot fail.
    let _ = text.write_fmt(words);
}

/// Returns text as HTML shows it.
fn escaped(text: &str) -> String {
    html! { (text) }.into_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_series_keep_their_extremes() {
        let mut points: Vec<(f64, f64)> = (0..50_000).map(|k| (f64::from(k), 0.0)).collect();
        points[12_345].1 = 9.0;
        points[12_346].1 = -9.0;
        let thin = thinned(&points);
        assert!(thin.len() <= 2 * COLUMNS);
        assert!(thin.contains(&(12_345.0, 9.0)) && thin.contains(&(12_346.0, -9.0)));
        assert!(thin.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn names_from_outside_are_escaped() {
        let chart = Chart {
            id: "a\"b".to_owned(),
            title: "<script>".to_owned(),
            x_label: "a & b".to_owned(),
            y_label: String::new(),
            x: X::Names(vec!["<i>".to_owned()]),
            y: (0.0, 1.0),
            is_y_logarithmic: false,
            layers: vec![Layer::new(Shape::Across(0.5), "c0", "<b>")],
        };
        let text = chart.markup().into_string();
        assert!(
            !text.contains("<script>")
                && !text.contains("<b>")
                && !text.contains("<i>")
                && !text.contains("<i>")
                && !text.contains("a\"b"),
            "{text}"
        );
        assert!(text.contains("a &amp; b"), "{text}");
    }
}
