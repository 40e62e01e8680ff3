//! The radio as a whole: the simulated one against sums written out here, the scene of Chim 2018, 5.6, through all faults, and recordings.

mod chirp;
mod echo;
mod faults;
mod leakage;
mod live;
mod profile;
mod rail;
mod recordings;
mod rig;
mod scene;
mod walk;
