//! Moving targets in simulated scenes.

mod images;
mod recording;
mod sub_cpis;
