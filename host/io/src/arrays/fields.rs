//! Arrays by name, read as collections and samples.

use std::collections::BTreeSet;

use glam::DVec3;
use num_complex::Complex32;

use super::Fault;
use super::convention::Stated;
use super::source::Source;
use crate::frequencies::fit_line;
use crate::npy::{Array, Values};
use subaperture_model::geometry::{Extent, Geodetic, SceneFrame};
use subaperture_model::phase_history::{Collection, PhaseReference, PhaseSign, Pulse, Sweep};

/// Names of all arrays that are read.
const NAMES: [&str; 14] = [
    "samples",
    "frequency_hz",
    "start_hz",
    "step_hz",
    "antenna_m",
    "transmitter_m",
    "receiver_m",
    "sign",
    "reference_m",
    "reference_path_m",
    "recorded_path_m",
    "time_s",
    "origin_deg_m",
    "extent_m",
];

/// Arrays of a file, read one by one.
pub(super) struct Fields {
    source: Source,
    names: BTreeSet<String>,
    left_bytes: u64,
    memory_bytes: u64,
}

/// Sizes of `samples`.
#[derive(Clone, Copy)]
struct Sizes {
    channels: usize,
    pulses: usize,
    frequencies: usize,
}

impl Fields {
    pub(super) fn new(source: Source, memory_bytes: u64) -> Result<Self, Fault> {
        let names: BTreeSet<String> = source.names()?.into_iter().collect();
        let strange: Vec<&str> = names
            .iter()
            .map(String::as_str)
            .filter(|name| !name.starts_with('_') && !NAMES.contains(name))
            .collect();
        if !names.contains("samples") {
            return Err(Fault::Malformed(format!(
                "not a phase history: expected an array 'samples', found {}; arrays that are read: {}",
                match strange.as_slice() {
                    [] => "no arrays (of HDF5 only the root group is read)".to_owned(),
                    some => listed(some),
                },
                listed(&NAMES)
            )));
        }
        if let [first, ..] = strange.as_slice() {
            return Err(Fault::Malformed(format!(
                "expected arrays {}, found '{first}': correct its name, or prefix it with _ to ignore it",
                listed(&NAMES)
            )));
        }
        Ok(Self {
            source,
            names,
            left_bytes: memory_bytes,
            memory_bytes,
        })
    }

    fn has(&self, name: &str) -> bool {
        self.names.contains(name)
    }

    fn array(&self, name: &str) -> Result<Array, Fault> {
        if !self.has(name) {
            return Err(Fault::Malformed(format!("array '{name}' is missing")));
        }
        Ok(self.source.array(name, self.left_bytes)?)
    }

    /// Real, finite numbers of one of the given shapes.
    fn real(&self, name: &str, shapes: &[&[usize]]) -> Result<Vec<f64>, Fault> {
        let array = self.array(name)?;
        let Values::Real(values) = array.values else {
            return Err(Fault::Malformed(format!(
                "array '{name}': expected real numbers, found complex ones"
            )));
        };
        if !shapes.contains(&array.shape.as_slice()) {
            let wanted: Vec<String> = shapes.iter().map(|shape| shaped(shape)).collect();
            return Err(Fault::Malformed(format!(
                "array '{name}': expected shape {1}, found {0}",
                shaped(&array.shape),
                wanted.join(" or ")
            )));
        }
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(values),
            Some(i) => Err(Fault::Malformed(format!(
                "array '{name}': expected finite values, found {} at index {i}",
                values[i]
            ))),
        }
    }

    /// Numbers given per pulse, or once for all `count` pulses.
    fn each(&self, name: &str, count: usize) -> Result<Vec<f64>, Fault> {
        let mut values = self.real(name, &[&[], &[1], &[count]])?;
        if let [one] = *values.as_slice() {
            values = vec![one; count];
        }
        Ok(values)
    }

    /// Samples, one channel after another.
    fn samples(&mut self) -> Result<(Vec<Complex32>, Sizes), Fault> {
        let array = self.array("samples")?;
        let Values::Complex(values) = array.values else {
            return Err(Fault::Malformed(
                "array 'samples': expected complex frequency samples, found real numbers"
                    .to_owned(),
            ));
        };
        let sizes = match *array.shape {
            [pulses, frequencies] => Sizes {
                channels: 1,
                pulses,
                frequencies,
            },
            [channels, pulses, frequencies] => Sizes {
                channels,
                pulses,
                frequencies,
            },
            _ => {
                return Err(Fault::Malformed(format!(
                    "array 'samples': expected shape pulses x frequencies or channels x pulses x frequencies, found {}",
                    shaped(&array.shape)
                )));
            }
        };
        if sizes.channels == 0 || sizes.pulses == 0 || sizes.frequencies < 2 {
            return Err(Fault::Malformed(format!(
                "array 'samples': expected at least 1 pulse of 2 frequencies, found shape {}",
                shaped(&array.shape)
            )));
        }
        let sample_bytes = size_of::<Complex32>() as u64 * values.len() as u64;
        // Several channels are copied out of the whole array, which is then freed.
        let copies = if sizes.channels > 1 { 2 } else { 1 };
        let pulses = (sizes.channels * sizes.pulses) as u64;
        // Per pulse: the `Pulse` and the numbers read for it.
        let needed = copies * sample_bytes + pulses * (size_of::<Pulse>() as u64 + 16 * 8);
        self.left_bytes = self
            .memory_bytes
            .checked_sub(needed)
            .ok_or(Fault::Memory(needed))?;
        // The rest is for the other arrays. At most three of the widest are in memory at a time.
        self.left_bytes += pulses * 16 * 8;
        Ok((values, sizes))
    }

    /// First frequency and step of every pulse.
    fn bands(&self, sizes: Sizes) -> Result<[Vec<f64>; 2], Fault> {
        let stepped = self.has("start_hz") || self.has("step_hz");
        if !self.has("frequency_hz") {
            return Ok([
                self.each("start_hz", sizes.pulses)?,
                self.each("step_hz", sizes.pulses)?,
            ]);
        }
        if stepped {
            return Err(Fault::Malformed(
                "both 'frequency_hz' and 'start_hz' or 'step_hz' are given: remove one of them"
                    .to_owned(),
            ));
        }
        let listed = self.real("frequency_hz", &[&[sizes.frequencies]])?;
        let (start_hz, step_hz) =
            fit_line(&listed).map_err(|what| format!("array 'frequency_hz': {what}"))?;
        Ok([start_hz, step_hz].map(|hz| vec![hz; sizes.pulses]))
    }

    /// Positions for every pulse of every channel.
    fn places(&self, name: &str, sizes: Sizes) -> Result<Vec<DVec3>, Fault> {
        let (channels, pulses) = (sizes.channels, sizes.pulses);
        let values = self.real(name, &[&[pulses, 3], &[channels, pulses, 3]])?;
        Ok(for_all_channels(places(&values), sizes))
    }

    /// Positions of the transmitting and the receiving antenna.
    fn antennas(&self, sizes: Sizes) -> Result<[Vec<DVec3>; 2], Fault> {
        let two = self.has("transmitter_m") || self.has("receiver_m");
        match (self.has("antenna_m"), two) {
            (true, true) => Err(Fault::Malformed(
                "both 'antenna_m' and 'transmitter_m' or 'receiver_m' are given: remove one of them".to_owned(),
            )),
            (true, false) => {
                let both = self.places("antenna_m", sizes)?;
                Ok([both.clone(), both])
            }
            (false, false) => Err(Fault::Malformed(
                "antenna positions are missing: give 'antenna_m', or 'transmitter_m' and 'receiver_m'".to_owned(),
            )),
            (false, true) => Ok([
                self.places("transmitter_m", sizes)?,
                self.places("receiver_m", sizes)?,
            ]),
        }
    }

    fn references(&self, sizes: Sizes) -> Result<Vec<DVec3>, Fault> {
        if !self.has("reference_m") {
            return Ok(vec![DVec3::ZERO; sizes.pulses]);
        }
        let values = self.real("reference_m", &[&[3], &[sizes.pulses, 3]])?;
        let mut places = places(&values);
        if let [one] = *places.as_slice() {
            places = vec![one; sizes.pulses];
        }
        Ok(places)
    }

    fn frame(&self) -> Result<SceneFrame, Fault> {
        if !self.has("origin_deg_m") {
            return Ok(SceneFrame::Local);
        }
        let values = self.real("origin_deg_m", &[&[3]])?;
        let origin = Geodetic {
            latitude_deg: values[0],
            longitude_deg: values[1],
            height_m: values[2],
        };
        let sound = origin.latitude_deg.abs() <= 90.0
            && origin.longitude_deg.abs() <= 360.0
            && origin.height_m.abs() <= 1e6;
        match sound {
            true => Ok(SceneFrame::east_north_up(&origin)),
            false => Err(Fault::Malformed(format!(
                "array 'origin_deg_m': expected latitude (-90 to 90) and longitude in degrees and height in metres, found {values:?}"
            ))),
        }
    }

    fn extent(&self) -> Result<Option<Extent>, Fault> {
        if !self.has("extent_m") {
            return Ok(None);
        }
        let values = self.real("extent_m", &[&[4]])?;
        if !(values[0] < values[1] && values[2] < values[3]) {
            return Err(Fault::Malformed(format!(
                "array 'extent_m': expected minimum and maximum x, minimum and maximum y, found {values:?}"
            )));
        }
        Ok(Some(Extent {
            x_m: (values[0], values[1]),
            y_m: (values[2], values[3]),
        }))
    }

    /// Interval of recorded two-way paths of every pulse.
    fn recorded(&self, sizes: Sizes) -> Result<Option<Vec<[f64; 2]>>, Fault> {
        if !self.has("recorded_path_m") {
            return Ok(None);
        }
        let values = self.real("recorded_path_m", &[&[2], &[sizes.pulses, 2]])?;
        let mut paths = values.as_chunks::<2>().0.to_vec();
        if let Some(n) = paths.iter().position(|[first, last]| first >= last) {
            return Err(Fault::Malformed(format!(
                "array 'recorded_path_m': expected the shortest and the longest path, found {:?} for pulse {n}",
                paths[n]
            )));
        }
        if let [one] = *paths.as_slice() {
            paths = vec![one; sizes.pulses];
        }
        Ok(Some(paths))
    }

    fn sign(&self) -> Result<Option<PhaseSign>, Fault> {
        if !self.has("sign") {
            return Ok(None);
        }
        match *self.real("sign", &[&[], &[1]])?.as_slice() {
            [-1.0] => Ok(Some(PhaseSign::Minus)),
            [1.0] => Ok(Some(PhaseSign::Plus)),
            ref other => Err(Fault::Malformed(format!(
                "array 'sign': expected -1 or 1, found {other:?}"
            ))),
        }
    }
}

/// Contents of a file: a collection and its samples for each channel.
pub(super) struct Parsed {
    pub(super) channels: Vec<(Collection, Vec<Complex32>)>,
    /// Stated phase convention. Samples are of the sign recorded; reference paths are those recorded, or 0.
    pub(super) stated: Stated,
}

impl Parsed {
    pub(super) fn read(mut fields: Fields) -> Result<Self, Fault> {
        let sign = fields.sign()?;
        let (frame, extent) = (fields.frame()?, fields.extent()?);
        let (mut samples, sizes) = fields.samples()?;
        let [start_hz, step_hz] = fields.bands(sizes)?;
        let [transmitters, receivers] = fields.antennas(sizes)?;
        let references = fields.references(sizes)?;
        let paths = match fields.has("reference_path_m") {
            true => {
                let each: [&[usize]; 2] = [&[sizes.pulses], &[sizes.channels, sizes.pulses]];
                let shapes: [&[usize]; 4] = [&[], &[1], each[0], each[1]];
                let mut values = fields.real("reference_path_m", &shapes)?;
                if let [one] = *values.as_slice() {
                    values = vec![one; sizes.pulses];
                }
                Some(for_all_channels(values, sizes))
            }
            false => None,
        };
        let reference = match (&paths, fields.has("reference_m")) {
            // Zero paths without a reference point: raw echoes.
            (Some(paths), false) if paths.iter().all(|path| *path == 0.0) => {
                Some(PhaseReference::Raw)
            }
            (Some(_), _) => Some(PhaseReference::Recorded),
            (None, true) => match references.as_slice() {
                [first, rest @ ..] if rest.iter().all(|point| point == first) => {
                    Some(PhaseReference::Point(*first))
                }
                _ => Some(PhaseReference::Recorded),
            },
            (None, false) => None,
        };
        let times = match fields.has("time_s") {
            true => Some(fields.real("time_s", &[&[sizes.pulses]])?),
            false => None,
        };
        if let Some(n) = times.as_ref().and_then(|times| falls_at(times)) {
            return Err(Fault::Malformed(format!(
                "array 'time_s': pulse {n} is earlier than the previous one; sort the pulses by time"
            )));
        }
        let recorded = fields.recorded(sizes)?;
        let pulse = |c: usize, n: usize| {
            let i = c * sizes.pulses + n;
            let mut pulse = Pulse {
                time_s: times.as_ref().map_or(n as f64, |times| times[n]),
                transmitter_m: transmitters[i],
                receiver_m: receivers[i],
                reference_m: references[n],
                reference_path_m: 0.0,
                start_hz: start_hz[n],
                step_hz: step_hz[n],
                sweep: Sweep::AT_ONCE,
                recorded_path_m: recorded.as_ref().map(|paths| paths[n]),
            };
            pulse.reference_path_m = match &paths {
                Some(paths) => paths[i],
                None => pulse.path_m(pulse.reference_m),
            };
            match pulse.fault(sizes.frequencies) {
                None => Ok(pulse),
                Some(what) => Err(Fault::Malformed(format!("pulse {n}: {what}"))),
            }
        };
        let width = sizes.pulses * sizes.frequencies;
        let mut channels = Vec::with_capacity(sizes.channels);
        for c in (0..sizes.channels).rev() {
            let own = match c {
                0 => {
                    samples.shrink_to_fit();
                    std::mem::take(&mut samples)
                }
                _ => samples.split_off(c * width),
            };
            let collection = Collection {
                name: String::new(),
                num_samples: sizes.frequencies,
                pulses: (0..sizes.pulses)
                    .map(|n| pulse(c, n))
                    .collect::<Result<_, _>>()?,
                frame,
                extent,
                timed: times.is_some(),
            };
            channels.push((collection, own));
        }
        channels.reverse();
        Ok(Self {
            channels,
            stated: Stated { sign, reference },
        })
    }
}

fn places(values: &[f64]) -> Vec<DVec3> {
    values
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&place| DVec3::from_array(place))
        .collect()
}

/// Values given once for all channels, or for each channel.
fn for_all_channels<T: Copy>(values: Vec<T>, sizes: Sizes) -> Vec<T> {
    match values.len() == sizes.pulses {
        true => values.repeat(sizes.channels),
        false => values,
    }
}

fn falls_at(times: &[f64]) -> Option<usize> {
    (1..times.len()).find(|&n| times[n] < times[n - 1])
}

fn listed(names: &[&str]) -> String {
    names.join(", ")
}

fn shaped(shape: &[usize]) -> String {
    match shape {
        [] => "of one number".to_owned(),
        sizes => {
            let sizes: Vec<String> = sizes.iter().map(ToString::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}
