//! Colours and styles that all figures share.

use plotters::style::RGBColor;

use super::panel::{Line, Marker, Style};

// Okabe and Ito's palette: distinguishable with any colour vision.
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
pub const VERMILLION: RGBColor = RGBColor(213, 94, 0);
pub const GREEN: RGBColor = RGBColor(0, 158, 115);
pub const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub const ORANGE: RGBColor = RGBColor(230, 159, 0);
pub const SKY: RGBColor = RGBColor(86, 180, 233);
pub const GREY: RGBColor = RGBColor(150, 150, 150);

pub fn solid(color: RGBColor) -> Style {
    Style {
        color,
        line: Line::Solid,
        marker: Marker::Dot,
    }
}

pub fn dashed(color: RGBColor) -> Style {
    Style {
        color,
        line: Line::Dashed,
        marker: Marker::None,
    }
}

pub fn thin(color: RGBColor) -> Style {
    Style {
        color,
        line: Line::Thin,
        marker: Marker::None,
    }
}

/// A line without marks.
pub fn plain(color: RGBColor) -> Style {
    Style {
        color,
        line: Line::Solid,
        marker: Marker::None,
    }
}

pub fn rings(color: RGBColor) -> Style {
    Style {
        color,
        line: Line::None,
        marker: Marker::Ring,
    }
}
