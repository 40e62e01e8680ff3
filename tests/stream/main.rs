//! The core without the link: every stage by itself, maps, chips and detection, in float and fixed point.

mod accumulate;
mod cfar;
mod channels;
mod chip;
mod dpca;
mod features;
mod fixed;
mod fixed_scene;
mod fixed_stages;
mod float;
mod kernel;
mod map;
mod memory;
mod motion;
mod odometer;
mod push;
mod selftest;
mod stages;
mod sweep;
