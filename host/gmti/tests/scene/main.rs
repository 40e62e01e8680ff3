//! Moving targets in simulated scenes.

mod counts;
mod evaluation;
mod images;
mod recording;
mod sub_cpis;
mod tracks;
