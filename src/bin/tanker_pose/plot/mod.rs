//! Figures of small panels as SVG, for the tools that draw.

pub mod panel;
pub mod scale;
pub mod style;
