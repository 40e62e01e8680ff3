//! Texts: scenarios, descriptions of recordings with their samples, and option values.

use std::path::Path;

use num_complex::Complex32;
use subaperture::describe::DescriptionError;
use subaperture::geometry::ImageGrid;
use subaperture::io::recording::{self, RecordingFile};
use subaperture::module::link::ModuleAddress;
use subaperture::phase_history::{PhaseHistory, ReadError};
use subaperture::simulate::scenario::{self, Scenario};
use subaperture::simulate::{Experiment, Pair};

use super::container::{pack, unpack};
use super::recordings::examine;
use super::scratch::with_files;
use super::{MEMORY_BYTES, arrays};
use crate::numpy::stored;

/// Maximum of points, pulses and samples in simulated experiments.
const MAX_POINTS: usize = 300;
const MAX_PULSES: usize = 4000;
const MAX_SAMPLES: usize = 2048;

pub(super) const SCENARIO_WORDS: &[&str] = &[
    "[radar]\n",
    "[radar.pulse]\n",
    "[[radar.transmitter]]\n",
    "[[radar.receiver]]\n",
    "[receiver]\n",
    "[platform]\n",
    "[[platform.shake]]\n",
    "[scene]\n",
    "[[scene.point]]\n",
    "[[scene.corner]]\n",
    "[[scene.mover]]\n",
    "[scene.origin]\n",
    "kind = \"fmcw\"\n",
    "kind = \"pulsed\"\n",
    "kind = \"stepped\"\n",
    "kind = \"ideal\"\n",
    "kind = \"linear\"\n",
    "kind = \"waypoints\"\n",
    "kind = \"arc\"\n",
    "motion = \"true\"\n",
    "\"0, 0, 0 m\"",
    " = ",
    "km",
    "GHz",
    "deg",
    "dB",
    "\"\"\"",
    "'''",
    "{",
    "}",
    "[",
    "]",
    "[[",
    "]]",
    "\\u0000",
];

pub(super) const RECORDING_WORDS: &[&str] = &[
    "[recording]\n",
    "[scene]\n",
    "[radar]\n",
    "[radar.pulse]\n",
    "[platform]\n",
    "format = \"dca1000\"\n",
    "format = \"npy\"\n",
    "format = \"npz\"\n",
    "layout = \"samples-pulses\"\n",
    "background = \"mean\"\n",
    "pulses = \"moving\"\n",
    "receivers = 4\n",
    "samples = 8\n",
    "kind = \"lfm\"\n",
    "kind = \"code\"\n",
    "kind = \"profiles\"\n",
    "kind = \"fmcw\"\n",
    "kind = \"stepped\"\n",
    "kind = \"arc\"\n",
    "kind = \"rail\"\n",
    " m\"",
    " s\"",
    " Hz\"",
    "range_bias = \"1 m\"\n",
    "first = 1\n",
    "every = 2\n",
    "count = 2\n",
];

pub(super) const ARGUMENT_WORDS: &[&str] = &[
    "x=", "y=", "z=", "r=", "theta=", "cx=", "cy=", "yaw=", "pitch=", "roll=", ":", ",", "tcp://",
    "serial:", "emulate:", "@", "[::1]", "float", "fixed", "1e9", "-", "0.1",
];

/// The examples, and one with only points.
pub(super) fn scenario_seeds() -> Vec<Vec<u8>> {
    let small = "[radar]\nkind = \"ideal\"\npulses = 8\npri = \"1 ms\"\ncentre = \"10 GHz\"\nbandwidth = \"200 MHz\"\n\
                 samples = 16\n\n[platform]\nkind = \"linear\"\nposition = \"0, -5, 3 km\"\nvelocity = \"100, 0, 0 m/s\"\n\n\
                 [[scene.point]]\nposition = \"10, 5, 0 m\"\n";
    let examples = scenario::examples::names().map(scenario::examples::text);
    let examples = examples
        .iter()
        .flatten()
        .map(|text| text.as_bytes().to_vec());
    examples.chain([small.as_bytes().to_vec()]).collect()
}

pub(super) fn scenario(bytes: &[u8]) -> String {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return "not text".to_owned();
    };
    match Scenario::new("input.toml", text, "/nowhere").experiment_within(MEMORY_BYTES) {
        Ok(experiment) => record(&experiment),
        Err(error) => error
            .faults
            .iter()
            .map(|fault| fault.message.as_str())
            .collect(),
    }
}

/// Simulate the first and the last pulse: finite, or an error.
fn record(experiment: &Experiment) -> String {
    let scene = &experiment.scene;
    let points = scene.points.len() + scene.moving_points.len() + scene.movers.len();
    let samples = experiment.radar.waveform.num_samples();
    if experiment.radar.num_pulses > MAX_PULSES || points > MAX_POINTS || samples > MAX_SAMPLES {
        return "large".to_owned();
    }
    let recording = match experiment.record(Pair {
        transmitter: 0,
        receiver: 0,
    }) {
        Ok(recording) => recording,
        Err(error) => return error.to_string(),
    };
    let collection = recording.collection();
    let mut pulse = vec![Complex32::ZERO; collection.num_samples];
    for n in [0, collection.pulses.len() - 1] {
        match recording.read(n..n + 1, &mut pulse) {
            Ok(()) => assert!(
                pulse.iter().all(|z| z.is_finite()),
                "samples that are not finite"
            ),
            Err(error) => return error.to_string(),
        }
    }
    format!(
        "a recording of {:?}",
        std::mem::discriminant(&experiment.radar.waveform)
    )
}

/// A description of each kind of radar with suitable samples.
pub(super) fn recording_seeds() -> Vec<Vec<u8>> {
    let platform =
        "[platform]\nkind = \"linear\"\nposition = \"0, -50, 10 m\"\nvelocity = \"1, 0, 0 m/s\"\n";
    let scene = "[scene]\nreference = \"0, 0, 0 m\"\nx = \"-5, 5 m\"\ny = \"-5, 5 m\"\n";
    let npy = arrays::image_bytes();
    let text = |recording: &str, radar: &str, platform: &str| {
        format!("[recording]\n{recording}\n{scene}[radar]\npri = \"10 ms\"\n{radar}\n{platform}")
            .into_bytes()
    };
    let plain = "format = \"npy\"\nfile = \"samples.npy\"\n";
    let stepped = "kind = \"stepped\"\nstart = \"9.6 GHz\"\nstep = \"2 MHz\"\n";
    let fmcw =
        "kind = \"fmcw\"\nstart = \"77 GHz\"\nslope = \"30 MHz/us\"\nsample_rate = \"5 MHz\"\n";
    let pulsed = "kind = \"pulsed\"\ncentre = \"9.6 GHz\"\nsample_rate = \"50 MHz\"\nwindow_start = \"0.3 us\"\n\
                  [radar.pulse]\nkind = \"lfm\"\nbandwidth = \"20 MHz\"\nduration = \"40 ns\"\n";
    let code = "kind = \"pulsed\"\ncentre = \"9.6 GHz\"\nsample_rate = \"50 MHz\"\nwindow_start = \"0.3 us\"\n\
                [radar.pulse]\nkind = \"code\"\nchip = \"20 ns\"\ncode = \"barker-13\"\n";
    let profiles = "kind = \"profiles\"\ncentre = \"4 GHz\"\nband = \"3.5, 4.5 GHz\"\nfirst_range = \"40 m\"\n\
                    range_step = \"0.1 m\"\n";
    let arc = "[platform]\nkind = \"arc\"\npivot = \"0, -50, 10 m\"\nradius = \"60 cm\"\nfrom_angle = \"60 deg\"\n\
               to_angle = \"120 deg\"\n";
    let dca = "format = \"dca1000\"\nfile = \"samples.bin\"\nsamples = 4\nreceivers = 2\nreceiver = 2\nphase = \"plus\"\n";
    let dca_bytes: Vec<u8> = (0..4 * 4 * 2 * 6).map(|i| (i * 37 % 251) as u8).collect();
    let times = stored(&[("s.npy", &npy), ("t.npy", &arrays::npy_seeds()[3])]);
    let npz = "format = \"npz\"\nfile = \"samples.npz\"\narray = \"s\"\ntimes = \"t\"\nbackground = \"mean\"\n";
    vec![
        pack(&text(plain, stepped, platform), &npy),
        pack(&text(plain, fmcw, arc), &npy),
        pack(&text(plain, pulsed, platform), &npy),
        pack(&text(plain, code, platform), &npy),
        pack(&text(plain, profiles, platform), &npy),
        pack(&text(dca, fmcw, platform), &dca_bytes),
        pack(
            &text(npz, stepped, platform).replace_bytes(b"pri = \"10 ms\"\n", b""),
            &times,
        ),
    ]
}

/// `str::replace` for bytes.
trait ReplaceBytes {
    fn replace_bytes(&self, from: &[u8], to: &[u8]) -> Vec<u8>;
}

impl ReplaceBytes for Vec<u8> {
    fn replace_bytes(&self, from: &[u8], to: &[u8]) -> Vec<u8> {
        let at = self.windows(from.len()).position(|window| window == from);
        match at {
            Some(at) => [&self[..at], to, &self[at + from.len()..]].concat(),
            None => self.clone(),
        }
    }
}

pub(super) fn recording(bytes: &[u8]) -> String {
    let (text, samples) = unpack(bytes);
    let Ok(text) = std::str::from_utf8(text) else {
        return "not text".to_owned();
    };
    // Only the files written here are read, whatever files the text names.
    let names = ["samples.npy", "samples.npz", "samples.bin"];
    if text.lines().any(|line| {
        line.trim_start().starts_with("file") && !names.iter().any(|name| line.contains(name))
    }) {
        return "another file".to_owned();
    }
    let files: [(&str, &[u8]); 3] = names.map(|name| (name, samples));
    with_files(&files, |folder: &Path| {
        let file = RecordingFile::new("input.toml", text, folder);
        match file.history(MEMORY_BYTES) {
            Ok(history) => examine(&history, bytes),
            Err(ReadError::Description(error)) => {
                let error = error.downcast_ref::<DescriptionError>();
                let faults = &error.expect("the faults of the text").faults;
                faults.iter().map(|fault| fault.message.as_str()).collect()
            }
            Err(other) => other.to_string(),
        }
    })
}

pub(super) fn argument_seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = [
        "x=-50:50:0.2,y=-50:50:0.2,z=0",
        "r=10:20:5,theta=0:180:90,cx=1,cy=-5,yaw=30,pitch=-4,roll=90",
        "serial:/dev/ttyACM0@115200",
        "tcp://[::1]:4000",
        "emulate:fixed",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec();
    let keys = recording::reference();
    seeds.extend(keys.lines().take(20).map(|line| line.as_bytes().to_vec()));
    seeds
}

pub(super) fn arguments(bytes: &[u8]) -> String {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return "not text".to_owned();
    };
    let grid = match text.parse::<ImageGrid>() {
        Ok(grid) => {
            assert!(grid.fault().is_none(), "{:?}", grid.fault());
            let corner = grid.position_m(grid.rows.count - 1, grid.columns.count - 1);
            assert!(corner.is_finite(), "{corner}");
            "a grid".to_owned()
        }
        Err(error) => error.to_string(),
    };
    let place = match text.parse::<ModuleAddress>() {
        Ok(place) => {
            assert_eq!(place.to_string().parse(), Ok(place));
            "a place".to_owned()
        }
        Err(error) => error.to_string(),
    };
    let mut varied = RecordingFile::new("input.toml", "", "/nowhere");
    let setting = match text
        .split_once('=')
        .map(|(key, value)| varied.set(key, value))
    {
        Some(Err(error)) => error
            .faults
            .iter()
            .map(|fault| fault.message.as_str())
            .collect(),
        Some(Ok(())) => "a setting".to_owned(),
        None => String::new(),
    };
    format!("{grid} {place} {setting}")
}
