//! Range-Doppler maps to show with the images: from a file of a module's maps, or computed from a recording around any point.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use anyhow::bail;
use glam::DVec3;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::geometry::SceneFrame;
use subaperture::image::ImageSourceError;
use subaperture::module::maps::Maps;
use subaperture::module::maps_file::MapFile;
use subaperture::module::range_doppler::map_about;
use subaperture::phase_history::{Joined, PhaseHistory};
use subaperture::viewer::product::{DopplerMap, DopplerMaps};

use crate::args::Input;
use crate::commands::stored;
use crate::config::Session;

/// Opened source of maps, and its memory.
pub(super) struct Opened {
    pub(super) maps: Box<dyn DopplerMaps>,
    /// Memory while the source is open, bytes.
    pub(super) held_bytes: u64,
    /// Additional memory while one map is computed, bytes.
    pub(super) map_bytes: u64,
}

/// Memory of computing a map of `pulses` x `samples`: the samples, and the map before and after its transforms.
fn making_bytes(pulses: usize, samples: usize) -> u64 {
    let bins = (2 * pulses as u64).max(3) * (2 * samples as u64).next_power_of_two();
    8 * pulses as u64 * samples as u64 + 16 * bins
}

/// Open the source of maps at a path.
pub(super) fn open(session: &Session, path: &Path, sub_cpi: usize) -> anyhow::Result<Opened> {
    let name = path.display().to_string();
    if stored::begins_with(path, b"SUBAPMAP") {
        let file = MapFile::open_within(path, session.memory_bytes / 4)?;
        if file.headers().is_empty() {
            bail!("{name}: expected maps, found none in the file");
        }
        // The index of a file is a part of it.
        let file_bytes = std::fs::metadata(path).map_or(u64::MAX, |about| about.len());
        let setup = file.run().setup;
        let bins = u64::from(setup.doppler_length) * u64::from(setup.range_length);
        return Ok(Opened {
            held_bytes: file_bytes.min(session.memory_bytes / 4),
            map_bytes: 24 * bins,
            maps: Box::new(OfFile::new(name, file)),
        });
    }
    let history = session.open(&Input::alone(path))?;
    if history.collection().band().is_none() {
        bail!("{name}: no range-Doppler maps: the frequency axis changes from pulse to pulse");
    }
    let pulses = history.collection().num_turns();
    let sub_cpi = sub_cpi.min(pulses);
    Ok(Opened {
        held_bytes: history.held_bytes(),
        map_bytes: making_bytes(sub_cpi, history.collection().num_samples),
        maps: Box::new(OfRecording {
            name,
            sub_cpi,
            pulses,
            history,
        }),
    })
}

/// Maps computed by a module for its patches.
struct OfFile {
    name: String,
    file: MapFile,
    /// Sub-CPIs that have maps, in order.
    sub_cpis: Vec<u32>,
    /// Centres of patches by their index.
    patches: BTreeMap<u16, DVec3>,
    /// Number of a map by sub-CPI and patch.
    numbers: HashMap<(u32, u16), usize>,
}

impl OfFile {
    fn new(name: String, file: MapFile) -> Self {
        let mut sub_cpis: Vec<u32> = file.headers().iter().map(|h| h.sub_cpi).collect();
        sub_cpis.sort_unstable();
        sub_cpis.dedup();
        let headers = file.headers().iter();
        let patches = headers
            .clone()
            .map(|h| (h.patch_index, h.patch.centre_m.into()));
        let numbers = headers
            .enumerate()
            .map(|(i, h)| ((h.sub_cpi, h.patch_index), i));
        Self {
            sub_cpis,
            patches: patches.collect(),
            numbers: numbers.collect(),
            name,
            file,
        }
    }
}

impl DopplerMaps for OfFile {
    fn name(&self) -> &str {
        &self.name
    }

    fn frame(&self) -> SceneFrame {
        self.file.run().frame
    }

    fn sub_cpis(&self) -> usize {
        self.sub_cpis.len()
    }

    fn map(&self, sub_cpi: usize, place_m: Option<DVec3>) -> Result<DopplerMap, ImageSourceError> {
        let sub_cpi = self.sub_cpis[sub_cpi];
        let there = |patch: &&u16| self.numbers.contains_key(&(sub_cpi, **patch));
        let off = |patch: &u16| place_m.map_or(0.0, |place| self.patches[patch].distance(place));
        let nearest = self.patches.keys().filter(there);
        let nearest = nearest.min_by(|a, b| off(a).total_cmp(&off(b)));
        // A sub-CPI is only listed where it has a map.
        let patch = *nearest.ok_or("there is no map of this sub-CPI")?;
        let map = self.file.read(self.numbers[&(sub_cpi, patch)])?;
        let (header, setup) = (map.header, self.file.run().setup);
        let (bin, timed) = doppler_bin(
            header.time_s,
            header.num_pulses.into(),
            setup.doppler_length.into(),
        );
        let range_m = SPEED_OF_LIGHT_M_S / (2.0 * f64::from(setup.range_length) * setup.step_hz);
        let scale = (1.0 / self.file.run().amplitude_scale()) as f32;
        Ok(DopplerMap {
            values: map.into_values().into_iter().map(|z| z * scale).collect(),
            reaches: [header.patch.doppler_reach, header.patch.range_reach].map(usize::from),
            steps: [bin, range_m],
            timed,
            place_m: header.patch.centre_m.into(),
            time_s: header.time_s,
            pulses: header.num_pulses.into(),
        })
    }
}

/// Doppler width of a bin, in hertz if pulses have times, else in cycles per pulse; and whether pulses have times.
fn doppler_bin(time_s: [f64; 2], pulses: usize, bins: usize) -> (f64, bool) {
    let interval_s = (time_s[1] - time_s[0]) / (pulses.max(2) - 1) as f64;
    match interval_s > 0.0 {
        true => (1.0 / (bins as f64 * interval_s), true),
        false => (1.0 / bins as f64, false),
    }
}

/// Maps computed from a recording on request, around the requested point.
struct OfRecording {
    name: String,
    history: Joined,
    /// Number of pulses in a sub-CPI.
    sub_cpi: usize,
    /// Pulses of the recording; of several channels, those of the first.
    pulses: usize,
}

impl DopplerMaps for OfRecording {
    fn name(&self) -> &str {
        &self.name
    }

    fn frame(&self) -> SceneFrame {
        self.history.collection().frame
    }

    fn sub_cpis(&self) -> usize {
        // Pulses after the last complete sub-CPI are not shown.
        (self.pulses / self.sub_cpi).max(1)
    }

    fn map(&self, sub_cpi: usize, place_m: Option<DVec3>) -> Result<DopplerMap, ImageSourceError> {
        let place_m = place_m.ok_or(
            "the positions of the image's pixels are unknown, so that no map can be computed for a pixel",
        )?;
        let first = sub_cpi * self.sub_cpi;
        let pulses = first..first + self.sub_cpi;
        let collection = self.history.collection();
        let ends = [first, pulses.end - 1].map(|n| collection.pulses[n].time_s);
        let map = map_about(&self.history, pulses, place_m)?;
        let bins = (1.0 / map.steps[0]).round() as usize;
        let (bin, _) = doppler_bin(ends, self.sub_cpi, bins);
        let timed = collection.timed && ends[1] > ends[0];
        Ok(DopplerMap {
            values: map.values,
            reaches: map.reaches,
            steps: [if timed { bin } else { map.steps[0] }, map.steps[1]],
            timed,
            place_m,
            time_s: ends,
            pulses: self.sub_cpi,
        })
    }
}
