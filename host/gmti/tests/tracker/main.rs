//! Tracker of GMTI detections: consistency, crossing targets, false alarms, deletion, folded velocities and refused input.

mod consistency;
mod crossing;
mod false_alarms;
mod folded;
mod refusals;
mod world;
