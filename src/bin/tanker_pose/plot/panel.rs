//! Figures of small panels as SVG: axes, curves, and the legend in the last cell.

use std::error::Error;

use plotters::coord::Shift;
use plotters::prelude::*;

use super::scale::{Axis, Scale};

const SIZE_PX: (u32, u32) = (1280, 640);
const ROWS_COLUMNS: (usize, usize) = (2, 4);
const FONT: &str = "sans-serif";
const DOT_PX: i32 = 3;

pub struct Figure {
    pub title: String,
    pub x_label: &'static str,
    /// At most one less than there are cells.
    pub panels: Vec<Panel>,
    /// Drawn into the last cell.
    pub legend: Vec<(String, Style)>,
    /// Lines below the legend.
    pub notes: Vec<String>,
}

pub struct Panel {
    pub title: String,
    pub curves: Vec<Curve>,
    pub y: Axis,
}

#[derive(Clone)]
pub struct Curve {
    pub points: Vec<(f64, f64)>,
    pub style: Style,
}

#[derive(Clone, Copy)]
pub struct Style {
    pub color: RGBColor,
    pub line: Line,
    pub marker: Marker,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Line {
    None,
    Solid,
    Thin,
    Dashed,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    None,
    Dot,
    Ring,
    Speck,
}

type Drawn<T = ()> = Result<T, Box<dyn Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>;

/// Returns the figure as text.
pub fn svg(figure: &Figure) -> Drawn<String> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE_PX).into_drawing_area();
        root.fill(&WHITE)?;
        let body = root.titled(&figure.title, (FONT, 20))?;
        let cells = body.split_evenly(ROWS_COLUMNS);
        for (cell, panel) in cells.iter().zip(&figure.panels) {
            draw_panel(cell, panel, figure.x_label)?;
        }
        if let Some(cell) = cells.last() {
            draw_legend(cell, figure)?;
        }
        root.present()?;
    }
    Ok(text)
}

fn draw_panel(cell: &Area, panel: &Panel, x_label: &str) -> Drawn {
    let all = || panel.curves.iter().flat_map(|curve| &curve.points);
    let x = Scale::around(all().map(|point| point.0));
    let y = Scale::new(panel.y, all().map(|point| point.1));
    let mut chart: Chart = ChartBuilder::on(cell)
        .caption(&panel.title, (FONT, 15))
        .margin(6)
        .x_label_area_size(36)
        .y_label_area_size(50)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .bold_line_style(RGBColor(225, 225, 225))
        .light_line_style(WHITE)
        .axis_style(RGBColor(120, 120, 120))
        .label_style((FONT, 12))
        .x_desc(x_label)
        .x_label_formatter(&|value| x.label(*value))
        .y_label_formatter(&|value| y.label(*value))
        .draw()?;
    for curve in &panel.curves {
        let points: Vec<(f64, f64)> = curve
            .points
            .iter()
            .filter_map(|&(x, value)| y.place(value).map(|value| (x, value)))
            .collect();
        draw_curve(&mut chart, &points, curve.style)?;
    }
    Ok(())
}

fn draw_curve(chart: &mut Chart, points: &[(f64, f64)], style: Style) -> Drawn {
    let stroke = style.color.stroke_width(style.line.width_px());
    let path = points.iter().copied();
    match style.line {
        Line::None => {}
        Line::Solid | Line::Thin => {
            chart.draw_series(LineSeries::new(path, stroke))?;
        }
        Line::Dashed => {
            chart.draw_series(DashedLineSeries::new(path, 8, 5, stroke))?;
        }
    }
    let markers = points.iter().copied();
    match style.marker {
        Marker::None => {}
        Marker::Dot => {
            chart.draw_series(markers.map(|at| Circle::new(at, DOT_PX, style.color.filled())))?;
        }
        Marker::Ring => {
            chart.draw_series(markers.map(|at| Circle::new(at, DOT_PX + 2, style.color)))?;
        }
        Marker::Speck => {
            chart.draw_series(markers.map(|at| Circle::new(at, 2, style.color.filled())))?;
        }
    }
    Ok(())
}

fn draw_legend(cell: &Area, figure: &Figure) -> Drawn {
    const LEFT: i32 = 24;
    const LINE_PX: i32 = 22;
    let mut y = 30;
    for (name, style) in &figure.legend {
        let stroke = style.color.stroke_width(style.line.width_px());
        match style.line {
            Line::None => {}
            Line::Solid | Line::Thin => {
                cell.draw(&PathElement::new(vec![(LEFT, y), (LEFT + 34, y)], stroke))?;
            }
            Line::Dashed => {
                for x in [0, 13, 26] {
                    let dash = vec![(LEFT + x, y), (LEFT + x + 8, y)];
                    cell.draw(&PathElement::new(dash, stroke))?;
                }
            }
        }
        let centre = (LEFT + 17, y);
        match style.marker {
            Marker::None => {}
            Marker::Dot => cell.draw(&Circle::new(centre, DOT_PX, style.color.filled()))?,
            Marker::Ring => cell.draw(&Circle::new(centre, DOT_PX + 2, style.color))?,
            Marker::Speck => cell.draw(&Circle::new(centre, 2, style.color.filled()))?,
        }
        cell.draw(&Text::new(name.clone(), (LEFT + 44, y - 7), (FONT, 14)))?;
        y += LINE_PX;
    }
    y += 6;
    for note in &figure.notes {
        cell.draw(&Text::new(
            note.clone(),
            (LEFT, y - 7),
            (FONT, 13).into_font().color(&RGBColor(90, 90, 90)),
        ))?;
        y += 18;
    }
    Ok(())
}

impl Line {
    fn width_px(self) -> u32 {
        match self {
            Self::Thin => 1,
            Self::None | Self::Solid | Self::Dashed => 2,
        }
    }
}
