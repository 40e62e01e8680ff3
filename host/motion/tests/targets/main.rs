//! Targets and tracks from simulated echoes, against the truth, against what noise does, and against what can be known.

mod echoes;
mod faults;
mod images;
mod live;
mod movers;
mod noise;
mod scene;
mod seeds;
mod tracks;
