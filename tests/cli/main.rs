//! The command `subap` as its users run it, and the benches' program.

mod autofocus;
mod bad_input;
mod bench;
mod channels;
mod echoes;
mod json;
mod killed;
mod locks;
mod maps;
mod means;
mod memory;
mod messages;
mod navigation;
mod output;
mod overwrite;
mod plan_radar;
mod quality;
mod recordings;
mod results;
mod simulate;
mod sources;
mod statistics;
mod tiles;
mod track;
mod usage;
