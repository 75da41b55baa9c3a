//! The drawing kit of reports, studies and benches: SVG panels, plots, key frames, figures with captions, one style.

pub mod distribution;
pub mod figure;
pub mod map;
pub mod plot;
pub mod style;
pub mod svg;
pub mod track;
