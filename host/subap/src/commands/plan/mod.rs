//! `subap plan`: what a module or a radar needs.

mod module;
mod radar;

use crate::args::{Plan, PlanTarget};
use crate::config::Session;

pub(crate) use module::gaps;

/// Prints the plan asked for.
pub(crate) fn run(session: &Session, typed: &Plan) -> anyhow::Result<()> {
    match &typed.target {
        PlanTarget::Module(typed) => module::run(session, typed),
        PlanTarget::Radar(typed) => radar::run(session, typed),
    }
}
