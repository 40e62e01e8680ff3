//! Targets and tracks from simulated echoes, compared with the truth, with simulated noise and with the Cramer-Rao bound.

mod echoes;
mod faults;
mod images;
mod live;
mod movers;
mod noise;
mod scene;
mod seeds;
mod tracks;
