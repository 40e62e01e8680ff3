//! Readers on logs that are written here, sound and damaged; the fusion on tracks that are simulated here.

mod damage;
mod forms;
mod fusion;
mod readers;
mod write;
