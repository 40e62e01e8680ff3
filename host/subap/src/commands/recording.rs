//! `subap recording`: print the description format of raw recordings, and examples.

use anyhow::Context;
use subaperture::io::{arrays, recording};

use crate::args::Recording;
use crate::text;

/// Next steps after the arrays are in a file.
const FIRST_STEPS: &str = "
First steps:
  subap info mine.npz               its contents, resolution and default grid
  subap focus mine.npz --out image  that image: image.npy, image.json and image.png
  subap focus mine.h5 --channel 2 --grid x=-20:20:0.1,y=-20:20:0.1 --out image2";

/// Print the requested text.
pub(crate) fn run(typed: &Recording) -> anyhow::Result<()> {
    if typed.keys {
        text::say(recording::reference())?;
    }
    if typed.arrays {
        text::say(arrays::SCHEMA)?;
        text::say(FIRST_STEPS)?;
    }
    if let Some(name) = &typed.example {
        text::say(recording::examples::text(name).context("--example: no such name")?)?;
    }
    Ok(())
}
