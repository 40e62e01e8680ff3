//! Readers on generated logs, valid and damaged, and fusion on simulated tracks.

mod damage;
mod forms;
mod fusion;
mod readers;
mod write;
mod written;
