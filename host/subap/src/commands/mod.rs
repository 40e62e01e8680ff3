//! Implementations of the commands, one module each.

mod analyser;
mod autofocus;
mod capture;
mod capture_files;
mod checks;
mod chirps;
mod compare;
mod completions;
mod crosscheck;
mod demo;
mod displacement;
mod export;
mod focus;
mod forming;
mod gmti;
mod info;
mod link;
mod live;
mod man;
mod module;
mod navigation;
mod pair;
mod picture;
mod plan;
mod profile;
mod quality;
mod radio;
mod rasters;
mod recording;
mod reproduce;
mod run;
mod simulate;
mod stored;
mod surface;
mod sweeps;
mod track;
mod track_fusion;
mod tune;
mod velocity;
#[cfg(feature = "page")]
mod view;

use crate::args::Command;
use crate::config::Session;
use crate::failure::Usage;

/// Run the command of a command line.
pub(crate) fn run(session: &Session, command: Command) -> anyhow::Result<()> {
    if session.json()
        && let Command::Completions(_) | Command::Man(_) | Command::Recording(_) = command
    {
        let fault = "--json has no effect on this command, which prints plain text: leave it out";
        return Err(Usage(fault.to_owned()).into());
    }
    match command {
        Command::Focus(typed) => focus::run(session, &typed),
        Command::Simulate(typed) => simulate::run(session, &typed),
        Command::Crosscheck(typed) => crosscheck::run(session, &typed),
        Command::Velocity(typed) => velocity::run(session, &typed),
        Command::Gmti(typed) => gmti::run(session, &typed),
        Command::Link(typed) => link::run(session, &typed),
        Command::Module(typed) => module::run(session, &typed),
        Command::Info(typed) => info::run(session, &typed),
        Command::Recording(typed) => recording::run(&typed),
        Command::Track(typed) => track::run(session, &typed),
        Command::Tune(typed) => tune::run(session, &typed),
        Command::Autofocus(typed) => autofocus::run(session, &typed),
        Command::Navigation(typed) => navigation::run(session, &typed),
        Command::Picture(typed) => picture::run(session, &typed),
        #[cfg(feature = "page")]
        Command::View(typed) => view::run(session, &typed),
        Command::Capture(typed) => capture::run(session, &typed),
        Command::Live(typed) => live::run(session, &typed),
        Command::Radio(typed) => radio::run(session, &typed),
        Command::Profile(typed) => profile::run(session, &typed),
        Command::Export(typed) => export::run(session, &typed),
        Command::Run(typed) => run::run(session, &typed),
        Command::Plan(typed) => plan::run(session, &typed),
        Command::Compare(typed) => compare::run(session, &typed),
        Command::Pair(typed) => pair::run(session, &typed),
        Command::Displacement(typed) => displacement::run(session, &typed),
        Command::Quality(typed) => quality::run(session, &typed),
        Command::Demo(typed) => demo::run(session, &typed),
        Command::Reproduce(typed) => reproduce::run(session, &typed),
        Command::Completions(typed) => completions::run(&typed),
        Command::Man(typed) => man::run(&typed),
    }
}
