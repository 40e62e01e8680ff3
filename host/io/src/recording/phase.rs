//! Sign of the phase and order of I and Q of a described recording: stated by its keys, or inferred from the sharpest image.
//!
//! `recording.phase` has no default: without a clearly sharper image the recording is refused. `recording.order` of int16 files defaults to
//! `iiqq`, with a warning.

use std::path::Path;

use subaperture_model::phase_history::convention::{InferenceOutcome, Probe, Sharpness, judge};
use subaperture_model::phase_history::{
    Basis, Collection, InMemory, Inference, PhaseConvention, PhaseHistory, PhaseReference,
    PhaseSign, ReadError,
};

use super::samples::SignStated;
use super::{RecordingFile, Take};

/// Value of the key for a sign.
fn value(sign: PhaseSign) -> &'static str {
    match sign {
        PhaseSign::Minus => "minus",
        PhaseSign::Plus => "plus",
    }
}

/// Possible orders of I and Q in an int16 file.
const ORDERS: [&str; 2] = ["iiqq", "iqiq"];

/// Sign, and an order if the description states none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Candidate {
    sign: PhaseSign,
    order: Option<&'static str>,
}

impl Candidate {
    /// Description with these values.
    fn of(self, file: &RecordingFile) -> Result<RecordingFile, ReadError> {
        let sign = ("recording.phase", value(self.sign));
        let order = self.order.map(|order| ("recording.order", order));
        Ok(file.with([sign].into_iter().chain(order))?)
    }
}

/// The convention in use, and contradictions to it.
pub(super) struct Signed {
    pub(super) convention: PhaseConvention,
    pub(super) warnings: Vec<String>,
    /// Keys that the description omits, with their inferred values.
    pub(super) inferred: Vec<(&'static str, &'static str)>,
    /// Description to read instead, where the inferred values differ from those used for `take`.
    pub(super) other: Option<RecordingFile>,
}

/// Determine sign and order of a recording. `take` was read as described, with `minus` and `iiqq` for missing keys.
///
/// # Errors
/// [`ReadError::Malformed`] with the key, where it is missing and the samples do not determine it; errors of reading the histories of some
/// pulses.
pub(super) fn settle(
    file: &RecordingFile,
    path: &Path,
    take: &Take,
    inference: Option<&Inference>,
    memory_bytes: u64,
) -> Result<Signed, ReadError> {
    // Raw samples have the phase of the whole path.
    let convention = |sign, sign_basis| PhaseConvention {
        sign,
        sign_basis,
        reference: PhaseReference::Raw,
        reference_basis: Basis::Stated,
    };
    let unstated = |why: String| ReadError::Malformed {
        path: path.to_owned(),
        what: format!(
            "[recording] phase is not given, {why}: give phase = \"minus\" (exp(-j 2 pi f delay)) or phase = \"plus\""
        ),
    };
    let stated = match take.sign {
        SignStated::Real => {
            return Ok(Signed {
                convention: convention(PhaseSign::Minus, Basis::Stated),
                warnings: Vec::new(),
                inferred: Vec::new(),
                other: None,
            });
        }
        SignStated::Stated(sign) => Some(sign),
        SignStated::Unstated => None,
    };
    let orders = if take.order_is_stated {
        vec![None]
    } else {
        ORDERS.map(Some).to_vec()
    };
    let mut warnings = Vec::new();
    let compared = match inference {
        Some(inference) => compare(file, take, inference, &orders, memory_bytes),
        None => Err("and inference is off".to_owned()),
    };
    let mut inferred = Vec::new();
    let order = if take.order_is_stated {
        None
    } else {
        match order(&compared, stated) {
            Ok(order) => {
                inferred.push(("recording.order", order));
                Some(order)
            }
            Err(why) => {
                warnings.push(format!(
                    "{}: [recording] order is not given, {why}; \"{}\" is assumed",
                    path.display(),
                    ORDERS[0]
                ));
                orders[0]
            }
        }
    };
    let clear = compared.and_then(|compared| {
        let index = orders.iter().position(|other| *other == order).unwrap_or(0);
        match judge(&compared.0[index]) {
            InferenceOutcome::Clear(best, ratio_db) => Ok((SIGNS[best], ratio_db)),
            InferenceOutcome::Alike(_) => {
                Err("and images are about equally sharp with both signs".to_owned())
            }
        }
    });
    let (sign, basis) = match (stated, clear) {
        (None, Ok((sign, _))) => (sign, Basis::Inferred),
        (None, Err(why)) => return Err(unstated(why)),
        (Some(sign), Ok((better, ratio_db))) if better != sign => {
            warnings.push(format!(
                "{}: [recording] phase is \"{}\", but an image of some pulses is {ratio_db:.1} dB sharper with \"{}\": check it",
                path.display(),
                value(sign),
                value(better)
            ));
            (sign, Basis::Stated)
        }
        (Some(sign), _) => (sign, Basis::Stated),
    };
    let taken = Candidate {
        sign: stated.unwrap_or(PhaseSign::Minus),
        order: orders[0],
    };
    let chosen = Candidate { sign, order };
    let other = (chosen != taken).then(|| chosen.of(file)).transpose()?;
    if basis == Basis::Inferred {
        inferred.push(("recording.phase", value(sign)));
    }
    Ok(Signed {
        convention: convention(sign, basis),
        warnings,
        inferred,
        other,
    })
}

const SIGNS: [PhaseSign; 2] = [PhaseSign::Minus, PhaseSign::Plus];

/// Order with the clearly sharper image, or the reason why it cannot be inferred.
fn order(
    compared: &Result<Compared, String>,
    stated: Option<PhaseSign>,
) -> Result<&'static str, &str> {
    let compared = compared.as_ref().map_err(String::as_str)?;
    match judge(&compared.by_order(stated)) {
        InferenceOutcome::Clear(best, _) => Ok(ORDERS[best]),
        InferenceOutcome::Alike(_) => Err("and images are about equally sharp in both orders"),
    }
}

/// Sharpness by order, then by sign as in [`SIGNS`].
struct Compared(Vec<[Sharpness; 2]>);

impl Compared {
    /// Sharpest image of each order, for the stated sign if any.
    fn by_order(&self, stated: Option<PhaseSign>) -> Vec<Sharpness> {
        let sharpest = |signs: &[Sharpness; 2]| match stated {
            Some(PhaseSign::Minus) => signs[0],
            Some(PhaseSign::Plus) => signs[1],
            None if signs[1].power > signs[0].power => signs[1],
            None => signs[0],
        };
        self.0.iter().map(sharpest).collect()
    }
}

/// Sharpness of a partial image for each order and sign, or the reason why no image can be formed.
fn compare(
    file: &RecordingFile,
    take: &Take,
    inference: &Inference,
    orders: &[Option<&'static str>],
    memory_bytes: u64,
) -> Result<Compared, String> {
    let compared = (inference.plan)(take.history.collection()).and_then(|probe| {
        let sharpness = |sign, order| {
            let part = part(file, take, &probe, Candidate { sign, order }, memory_bytes)?;
            (inference.sharpness)(&probe, &part, memory_bytes)
        };
        let by_order = |&order| Ok([sharpness(SIGNS[0], order)?, sharpness(SIGNS[1], order)?]);
        orders.iter().map(by_order).collect()
    });
    compared
        .map(Compared)
        .map_err(|why: String| format!("and it cannot be inferred ({why})"))
}

/// Pulses and frequencies used for the comparison, for one candidate.
fn part(
    file: &RecordingFile,
    take: &Take,
    probe: &Probe,
    candidate: Candidate,
    memory_bytes: u64,
) -> Result<InMemory, String> {
    let words = |error: ReadError| error.to_string();
    let wanted: Vec<usize> = probe.pulses.iter().map(|&n| take.pulses[n]).collect();
    let some = candidate.of(file);
    let some = some.and_then(|file| file.take(memory_bytes, Some(&wanted)));
    let history = some.map_err(words)?.history;
    let whole = history.collection();
    let mut samples = vec![num_complex::Complex32::ZERO; whole.pulses.len() * whole.num_samples];
    history
        .read(0..whole.pulses.len(), &mut samples)
        .map_err(words)?;
    let rows = samples.chunks_exact(whole.num_samples);
    let kept = rows.flat_map(|row| row[probe.samples.clone()].iter().copied());
    let pulses = whole.pulses.iter().map(|pulse| {
        let mut pulse = *pulse;
        pulse.start_hz = pulse.frequency_hz(probe.samples.start);
        pulse
    });
    let collection = Collection {
        name: whole.name.clone(),
        num_samples: probe.samples.len(),
        pulses: pulses.collect(),
        ..*whole
    };
    InMemory::new(collection, kept.collect()).map_err(words)
}
