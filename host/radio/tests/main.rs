//! Integration tests of the radio: simulated radio against written-out sums, the scene of Chim 2018, 5.6, under all
//! faults, and recordings.

mod chirp;
mod echo;
mod faults;
mod leakage;
mod live;
mod profile;
mod rail;
mod recordings;
mod rig;
mod scatterers;
mod scene;
mod selftest;
mod walk;
