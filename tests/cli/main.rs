//! The command `subap` as its users run it, and the benches' program.

mod autofocus;
mod bad_input;
mod bench;
mod capture;
mod channels;
#[path = "../../host/viewer/tests/driver.rs"]
mod driver;
mod echoes;
mod export;
mod json;
mod killed;
mod live;
mod locks;
mod maps;
mod means;
mod memory;
mod messages;
mod navigation;
mod output;
mod overwrite;
mod picture;
mod plan_radar;
mod quality;
mod rail_scan;
mod recordings;
mod results;
mod run;
mod simulate;
mod sources;
mod spaceborne;
mod statistics;
mod surface;
mod tiles;
mod track;
mod usage;
mod view;
