//! The page of a recording and of several: HTML with charts in it, without scripts and without anything from elsewhere.
//!
//! ```text
//! sections        what is said of a recording, section by section
//! tables          its tables
//! errors          charts of errors against the truth
//! levels          Stanford diagrams
//! frames          charts of refusals, states, modes, residuals
//! times           charts of stamps and delays
//! fleet           the page of several recordings
//! chart, scale    a chart as SVG
//! document, style what is around it, and the style sheet
//! numbers         numbers as tables show them
//! ```

mod chart;
mod document;
mod errors;
mod fleet;
mod frames;
mod levels;
mod numbers;
mod scale;
mod sections;
mod style;
mod tables;
mod times;

pub use fleet::fleet_page;
pub use sections::page;
