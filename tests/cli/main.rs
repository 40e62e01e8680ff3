//! The command `subap` as its users run it.

mod bad_input;
mod channels;
mod echoes;
mod json;
mod killed;
mod locks;
mod maps;
mod memory;
mod messages;
mod output;
mod overwrite;
mod plan_radar;
mod quality;
mod recordings;
mod results;
mod simulate;
mod sources;
mod tiles;
mod usage;
