//! `subap recording`: how raw recordings are described.

use anyhow::Context;
use subaperture::io::{arrays, recording};

use crate::args::Recording;
use crate::text;

/// Prints what was asked for.
pub(crate) fn run(typed: &Recording) -> anyhow::Result<()> {
    if typed.keys {
        text::say(recording::reference())?;
    }
    if typed.arrays {
        text::say(arrays::SCHEMA)?;
    }
    if let Some(name) = &typed.example {
        text::say(recording::examples::text(name).context("--example: no such name")?)?;
    }
    Ok(())
}
