//! Phase sign and reference of arrays: stated, or inferred from image sharpness.

use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::phase_history::convention::{InferenceOutcome, Probe, Sharpness, judge};
use subaperture_model::phase_history::{
    Basis, Collection, InMemory, Inference, PhaseConvention, PhaseReference, PhaseSign,
};

/// Phase convention stated by the arrays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stated {
    pub(super) sign: Option<PhaseSign>,
    pub(super) reference: Option<PhaseReference>,
}

/// Phase convention, and the arrays that contradict it.
pub(super) struct Settled {
    pub(super) convention: PhaseConvention,
    pub(super) warning: Option<String>,
}

/// Keys that state sign and reference.
const STATE_BOTH: &str = "'sign' (-1 or 1), and 'reference_path_m' (0 for raw echoes) or 'reference_m' (the point that the phase is compensated to)";

/// Phase sign and reference to compare.
type Candidate = (PhaseSign, PhaseReference);

impl Stated {
    fn known(&self) -> Option<Candidate> {
        self.sign.zip(self.reference)
    }

    /// Candidate conventions: all values of an unstated property, only the stated value of a stated one.
    fn candidates(&self, collection: &Collection) -> Vec<Candidate> {
        let signs = self
            .sign
            .map_or(vec![PhaseSign::Minus, PhaseSign::Plus], |sign| vec![sign]);
        let references = self
            .reference
            .map_or_else(|| usual(collection), |reference| vec![reference]);
        let of_sign = |sign| references.iter().map(move |&reference| (sign, reference));
        signs.into_iter().flat_map(of_sign).collect()
    }

    /// Names of the missing keys, for messages.
    fn missing(&self) -> &'static str {
        match (self.sign, self.reference) {
            (None, None) => STATE_BOTH,
            (None, Some(_)) => "'sign', -1 or 1",
            _ => {
                "'reference_path_m' (0 for raw echoes) or 'reference_m' (the point that the phase is compensated to)"
            }
        }
    }
}

/// Common phase references, tried where the file states none: raw echoes, the origin, the centre of the extent.
fn usual(collection: &Collection) -> Vec<PhaseReference> {
    let mut all = vec![PhaseReference::Raw, PhaseReference::Point(DVec3::ZERO)];
    if let Some(extent) = collection.extent {
        let middle = |(low, high): (f64, f64)| low.midpoint(high);
        let centre = DVec3::new(middle(extent.x_m), middle(extent.y_m), 0.0);
        if centre != DVec3::ZERO {
            all.push(PhaseReference::Point(centre));
        }
    }
    all
}

/// Determine the phase convention. `collection` has the stated reference, if any, and the recorded sign. Errors name
/// the keys to give.
pub(super) fn settle(
    path: &Path,
    (collection, samples): (&Collection, &[Complex32]),
    stated: Stated,
    inference: Option<&Inference>,
    memory_bytes: u64,
) -> Result<Settled, String> {
    let probed = Probed {
        collection,
        samples,
        memory_bytes,
    };
    if let Some((sign, reference)) = stated.known() {
        let convention = PhaseConvention::stated(sign, reference);
        // Where the geometry permits no inference, the stated convention is used unchecked.
        let better = inference
            .and_then(|inference| probed.contradiction(inference, (sign, reference)).ok()?);
        return Ok(Settled {
            convention,
            warning: better.map(|((better_sign, better_reference), ratio_db)| {
                format!(
                    "{}: the phase is stated as sign {sign}, {reference}, but an image of some pulses is {ratio_db:.1} dB sharper with sign {better_sign}, \
                     {better_reference}: check 'sign', 'reference_path_m' and 'reference_m'",
                    path.display()
                )
            }),
        });
    }
    let missing = stated.missing();
    let Some(inference) = inference else {
        return Err(format!(
            "the phase convention is not stated: give {missing}"
        ));
    };
    let candidates = stated.candidates(collection);
    let sharpness = (inference.plan)(collection)
        .and_then(|probe| probed.sharpness(inference, &probe, &candidates))
        .map_err(|why| {
            format!(
                "the phase convention is not stated and cannot be inferred ({why}): give {missing}"
            )
        })?;
    match judge(&sharpness) {
        InferenceOutcome::Clear(best, _) => {
            let (sign, reference) = candidates[best];
            let basis = |is_stated: bool| match is_stated {
                true => Basis::Stated,
                false => Basis::Inferred,
            };
            Ok(Settled {
                convention: PhaseConvention {
                    sign,
                    sign_basis: basis(stated.sign.is_some()),
                    reference,
                    reference_basis: basis(stated.reference.is_some()),
                },
                warning: None,
            })
        }
        InferenceOutcome::Alike(alike) => Err(undecided(stated, &candidates, &alike)),
    }
}

/// Error for candidates of about equal sharpness, with the keys to give.
fn undecided(stated: Stated, candidates: &[Candidate], alike: &[usize]) -> String {
    let (sign, reference) = candidates[alike[0]];
    let signs = alike.iter().any(|&i| candidates[i].0 != sign);
    let references = alike.iter().any(|&i| candidates[i].1 != reference);
    let listed: Vec<String> = (alike.iter().map(|&i| candidates[i]))
        .map(|(sign, reference)| format!("sign {sign}, {reference}"))
        .collect();
    let needed = Stated {
        sign: stated.sign.or((!signs).then_some(sign)),
        reference: stated.reference.or((!references).then_some(reference)),
    };
    format!(
        "the phase convention is not stated, and images are about equally sharp with {}: give {}",
        listed.join("; "),
        needed.missing()
    )
}

/// Samples from which the convention is inferred.
struct Probed<'a> {
    collection: &'a Collection,
    samples: &'a [Complex32],
    memory_bytes: u64,
}

impl Probed<'_> {
    /// Convention whose image is clearly sharper than with the stated one, and the sharpness ratio in dB.
    fn contradiction(
        &self,
        inference: &Inference,
        stated: Candidate,
    ) -> Result<Option<(Candidate, f64)>, String> {
        let (sign, reference) = stated;
        let mut candidates = vec![stated, (sign.opposite(), reference)];
        let others = usual(self.collection).into_iter();
        let others = others.filter(|other| *other != reference);
        candidates.extend(others.flat_map(|other| [(sign, other), (sign.opposite(), other)]));
        let probe = (inference.plan)(self.collection)?;
        let sharpness = self.sharpness(inference, &probe, &candidates)?;
        Ok(match judge(&sharpness) {
            InferenceOutcome::Clear(best, ratio_db) if best != 0 => {
                Some((candidates[best], ratio_db))
            }
            _ => None,
        })
    }

    fn sharpness(
        &self,
        inference: &Inference,
        probe: &Probe,
        candidates: &[Candidate],
    ) -> Result<Vec<Sharpness>, String> {
        let of = |&candidate: &Candidate| {
            let part = self.part(probe, candidate)?;
            (inference.sharpness)(probe, &part, self.memory_bytes)
        };
        candidates.iter().map(of).collect()
    }

    /// Pulses and frequencies used for the comparison, in one candidate's convention.
    fn part(&self, probe: &Probe, (sign, reference): Candidate) -> Result<InMemory, String> {
        let width = self.collection.num_samples;
        let mut samples = Vec::with_capacity(probe.pulses.len() * probe.samples.len());
        let mut pulses = Vec::with_capacity(probe.pulses.len());
        for &n in &probe.pulses {
            let mut pulse = self.collection.pulses[n];
            reference.set(&mut pulse);
            pulse.start_hz = pulse.frequency_hz(probe.samples.start);
            pulses.push(pulse);
            let row = &self.samples[n * width..(n + 1) * width][probe.samples.clone()];
            match sign {
                PhaseSign::Minus => samples.extend_from_slice(row),
                PhaseSign::Plus => samples.extend(row.iter().map(Complex32::conj)),
            }
        }
        let part = Collection {
            name: self.collection.name.clone(),
            num_samples: probe.samples.len(),
            pulses,
            ..*self.collection
        };
        InMemory::new(part, samples).map_err(|error| error.to_string())
    }
}
