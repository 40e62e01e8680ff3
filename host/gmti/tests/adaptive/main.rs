//! Adaptive detection against hand-computed cases, simulated counts and closed forms.

mod closed_forms;
mod counts;
mod interferometry;
mod loss;
mod matrices;
mod noise;
mod targets;
