//! The command `subap` as its users run it, and the benches' program.

mod accuracy_table;
mod any_file;
mod autofocus;
mod bad_input;
mod beam;
mod bench;
mod capture;
mod cases;
mod channels;
mod claimed_sizes;
mod compare;
mod completions;
#[path = "../../host/viewer/tests/driver.rs"]
mod driver;
mod echoes;
mod every_command;
mod export;
#[cfg(target_os = "linux")]
mod failing_writes;
mod gmti;
mod guide;
mod hostile;
mod json;
mod killed;
mod live;
mod locks;
mod maps;
mod memory;
mod messages;
mod navigation;
mod output;
mod overwrite;
mod parsed_memory;
mod parts;
mod picture;
mod plan_focus;
mod plan_radar;
mod quality;
mod quiet;
mod rail_scan;
mod recordings;
mod results;
mod run;
mod simulate;
mod sources;
mod spaceborne;
mod statistics;
mod surface;
mod target_motion;
#[cfg(target_os = "linux")]
mod thread_limits;
mod tiles;
mod timing_model;
mod track;
mod usage;
mod view;
