//! `subap simulate`: a simulated collection as CPHD 1.1.

use subaperture::io::cphd::{self, Channel, Domain, Sgn, WriteOptions};
use subaperture::phase_history::PhaseHistory;
use subaperture::simulate::{Noise, Variation};

use crate::args::{SignalDomain, Simulate};
use crate::config::Session;
use crate::text;

/// Writes the file, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Simulate) -> anyhow::Result<()> {
    let simulated = typed.preset.simulate(&Variation {
        noise: typed.noise_db.map(|power_db| Noise {
            power_db,
            seed: typed.seed,
        }),
        perturbation_m: typed.perturb,
        seed: typed.seed,
    });
    let options = WriteOptions {
        domain: match typed.domain {
            SignalDomain::Fx => Domain::Fx,
            SignalDomain::Toa => Domain::Toa,
        },
        sgn: if typed.sgn < 0 { Sgn::Minus } else { Sgn::Plus },
        ..WriteOptions::default()
    };
    let progress = session.progress("simulating");
    let channels = [Channel::new("1", &simulated)];
    cphd::write(&typed.out, &channels, &options, &progress)?;
    progress.finish();
    if !session.quiet() {
        let collection = simulated.collection();
        text::say(format!(
            "{}: {} pulses of {} frequencies",
            typed.out.display(),
            collection.pulses.len(),
            collection.num_samples
        ))?;
    }
    Ok(())
}
