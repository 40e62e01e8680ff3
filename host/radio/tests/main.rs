//! The radio as a whole: the simulated one against sums written out here, the scene of Chim 2018, 5.6, through all faults, and recordings.

mod echo;
mod faults;
mod profile;
mod recordings;
mod scene;
