//! Recordings: CPHD and MATLAB files, and images from them.

use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{Extent, ImageGrid, SceneFrame};
use subaperture::io::cphd::{Channel, Cphd, CphdInfo, Domain, Sgn, WriteOptions, write};
use subaperture::io::gotcha;
use subaperture::io::open::{Options, open_bytes, open_sum};
use subaperture::monitor::Silent;
use subaperture::phase_history::{
    Collection, InMemory, PhaseHistory, Pulse, ReadError, Sweep, Weights,
};
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;

use super::scratch::with_files;
use super::{MEMORY_BYTES, choice};
use crate::matlab::{self, compressed, gotcha_fields};

/// Maximum of samples read from a recording; a file may contain many without being large.
const MAX_SAMPLES: usize = 1 << 16;

/// Maximum of samples for which an image is formed.
const MAX_FORMED: usize = 4096;

pub(super) const CPHD_WORDS: &[&str] = &[
    "<Channel>",
    "</Channel>",
    "<Parameters>",
    "</Parameters>",
    "<Identifier>",
    "<SRPFixed>",
    "<FxC>",
    "<AmpSF>",
    "<SIGNAL>",
    "<AddedPVP>",
    "<Name>TxPosTrue</Name>",
    "<HAE>",
    "<Planar>",
    "CI2",
    "CI4",
    "CF8",
    "TOA",
    "FX",
    "+1",
    "-1",
    "<!--",
    "-->",
    "<![CDATA[",
    "]]>",
    "&lt;",
    "&#0;",
    "SUPPORT_BLOCK_SIZE := 1\n",
    "\x0c\n",
];

pub(super) const MATLAB_WORDS: &[&str] = &[
    "data",
    "fp",
    "freq",
    "x",
    "y",
    "z",
    "r0",
    "\0\0\0\0",
    "\x0e\0\0\0",
    "\x0f\0\0\0",
];

/// An aircraft 5 km away over the equator.
fn scene(num_pulses: usize, num_samples: usize) -> InMemory {
    scene_apart(num_pulses, num_samples, 0.0)
}

/// The same with the receiver separate from the transmitter.
fn scene_apart(num_pulses: usize, num_samples: usize, apart_m: f64) -> InMemory {
    let pulse = |n: usize| {
        let antenna = DVec3::new(12.0 * n as f64 - 30.0, -4000.0, 3000.0);
        Pulse {
            time_s: 0.1 * n as f64,
            transmitter_m: antenna,
            receiver_m: antenna + DVec3::X * apart_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * antenna.length(),
            start_hz: 9.6e9,
            step_hz: 2e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    let collection = Collection {
        name: "seed".to_owned(),
        num_samples,
        pulses: (0..num_pulses).map(pulse).collect(),
        frame: SceneFrame::Earth {
            origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
            x_axis_ecf: DVec3::Y,
            y_axis_ecf: DVec3::Z,
        },
        extent: Some(Extent {
            x_m: (-20.0, 20.0),
            y_m: (-15.0, 15.0),
        }),
        timed: true,
    };
    let samples = (0..num_pulses * num_samples).map(|i| Complex32::cis(i as f32));
    InMemory::new(collection, samples.collect()).expect("a sound collection")
}

pub(super) fn cphd_seeds() -> Vec<Vec<u8>> {
    let (first, second) = (scene(4, 6), scene(3, 9));
    let one = [Channel::new("A", &first)];
    let two = [Channel::new("A", &first), Channel::new("B", &second)];
    let apart = scene_apart(4, 6, 3.0);
    let both = [Channel::new("A", &first), Channel::new("B", &apart)];
    let (minus, plus) = (Sgn::Minus, Sgn::Plus);
    let files: [(&[Channel], Domain, Sgn); 5] = [
        (&both, Domain::Fx, minus),
        (&one, Domain::Fx, minus),
        (&one, Domain::Toa, plus),
        (&two, Domain::Fx, plus),
        (&two, Domain::Toa, minus),
    ];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("seed.cphd");
    let mut seeds = Vec::new();
    for (channels, domain, sgn) in files {
        let options = WriteOptions {
            domain,
            sgn,
            ..WriteOptions::default()
        };
        write(&path, channels, &options, &Silent).expect("a file is written");
        let bytes = std::fs::read(&path).expect("a file is read");
        // The same samples declared as integers.
        let text = String::from_utf8_lossy(&bytes);
        if domain == Domain::Fx && text.contains(">CF8<") {
            let at = bytes.windows(5).position(|w| w == b">CF8<");
            let mut integers = bytes.clone();
            let at = at.expect("it was found") + 1;
            integers[at..at + 3].copy_from_slice(b"CI4");
            seeds.push(integers);
        }
        seeds.push(bytes);
    }
    seeds
}

pub(super) fn matlab_seeds() -> Vec<Vec<u8>> {
    let whole = matlab::gotcha(gotcha_fields());
    let packed = matlab::file(&[compressed(&whole[128..])]);
    let text = matlab::matrix("note", &matlab::Value::Text("before the data"));
    let second = [&whole[..128], &text[..], &whole[128..]].concat();
    vec![whole, packed, second]
}

pub(super) fn cphd(bytes: &[u8]) -> String {
    with_files(&[("input.cphd", bytes)], |folder| {
        let path = folder.join("input.cphd");
        let info = match CphdInfo::read(&path) {
            Ok(info) => info,
            Err(error) => return error.to_string(),
        };
        let mut outcome = String::new();
        let named = info
            .channels
            .iter()
            .take(2)
            .map(|channel| Some(channel.id.as_str()));
        for channel in named.chain([None]) {
            outcome += &match Cphd::open(&path, channel, MEMORY_BYTES) {
                Ok(history) => {
                    if channel.is_none() {
                        agree_in_memory(&path, bytes, &history);
                    }
                    let again = folder.join("again.cphd");
                    format!(
                        "{:?} {} {}",
                        info.domain,
                        examine(&history, bytes),
                        written_again(&history, &again, bytes)
                    )
                }
                Err(error) => error.to_string(),
            };
        }
        let options = Options {
            memory_bytes: MEMORY_BYTES,
            ..Options::default()
        };
        outcome += &match open_sum::<_, &str>(&[&path], None, &options) {
            Ok(sum) => examine(&sum, bytes),
            Err(error) => error.to_string(),
        };
        outcome
    })
}

pub(super) fn matlab(bytes: &[u8]) -> String {
    with_files(&[("input.mat", bytes)], |folder| {
        let path = folder.join("input.mat");
        match gotcha::read(&path, MEMORY_BYTES) {
            Ok(history) => {
                agree_in_memory(&path, bytes, &history);
                examine(&history, bytes)
            }
            Err(error) => error.to_string(),
        }
    })
}

/// The data after the header are compressed here, so that mutations change the content and not the compression.
pub(super) fn matlab_packed(bytes: &[u8]) -> String {
    let (header, element) = bytes.split_at(bytes.len().min(128));
    matlab(&[header, &compressed(element)].concat())
}

/// Read the bytes of a file in memory: the samples are those of the file, or the memory does not suffice for the bytes.
pub(super) fn agree_in_memory(path: &Path, bytes: &[u8], of_file: &dyn PhaseHistory) {
    let options = Options {
        memory_bytes: MEMORY_BYTES,
        ..Options::default()
    };
    match open_bytes(path, bytes.to_vec(), &options) {
        Ok(history) => {
            assert_eq!(history.collection().pulses, of_file.collection().pulses);
            let [got, expected] = [&*history, of_file].map(samples);
            assert_eq!(got.ok(), expected.ok());
        }
        Err(ReadError::Memory { .. }) => {}
        Err(error) => panic!("accepted as a file and refused in memory: {error}"),
    }
}

/// Samples read from a history; asserts that each is finite.
fn samples(history: &dyn PhaseHistory) -> Result<Vec<Complex32>, String> {
    let collection = history.collection();
    let width = collection.num_samples;
    let pulses = collection.pulses.len().min(MAX_SAMPLES / width.max(1));
    let mut samples = vec![Complex32::ZERO; pulses * width];
    history
        .read(0..pulses, &mut samples)
        .map_err(|error| error.to_string())?;
    assert!(
        samples.iter().all(|z| z.is_finite()),
        "samples that are not finite"
    );
    Ok(samples)
}

/// Read a history and form an image of a few pixels; it is finite, or an error with a reason.
pub(super) fn examine(history: &dyn PhaseHistory, bytes: &[u8]) -> String {
    let collection = history.collection();
    assert!(
        history.held_bytes() <= MEMORY_BYTES,
        "{} bytes held",
        history.held_bytes()
    );
    for pulse in &collection.pulses {
        let places = [pulse.transmitter_m, pulse.receiver_m, pulse.reference_m];
        assert!(places.iter().all(|p| p.is_finite()) && pulse.reference_path_m.is_finite());
        let last_hz = pulse.frequency_hz(collection.num_samples);
        assert!(pulse.start_hz > 0.0 && pulse.step_hz > 0.0 && last_hz.is_finite());
    }
    if let Err(error) = samples(history) {
        return error;
    }
    let Some(survey) = Survey::of(collection) else {
        return "no survey".to_owned();
    };
    if collection.num_samples * collection.pulses.len() > MAX_FORMED {
        return "large".to_owned();
    }
    let wide = match survey.default_grid() {
        Ok(found) => found.grid,
        Err(error) => return error.to_string(),
    };
    assert!(wide.fault().is_none(), "{:?} of {wide:?}", wide.fault());
    let mut grid = wide.clone();
    (grid.rows.count, grid.columns.count) = (wide.rows.count.min(4), wide.columns.count.min(5));
    image(history, &grid, bytes)
}

fn image(history: &dyn PhaseHistory, grid: &ImageGrid, bytes: &[u8]) -> String {
    let error_db = -40.0;
    let formers: [&dyn ImageFormer; 7] = [
        &Exact,
        &Backprojection { error_db },
        &RangeDopplerBackprojection {
            mode: Mode::Precise,
            error_db,
            sub_cpi: None,
            patch_m: None,
        },
        &FastFactorised { error_db },
        &PolarFormat {
            error_db,
            centre_m: None,
        },
        &OmegaK { error_db },
        &RangeDopplerAlgorithm {
            error_db,
            secondary_compression: true,
        },
    ];
    let former = formers[choice(bytes, formers.len() as u32) as usize];
    let window = Window::Taylor { side_lobe_db: 35.0 };
    let weights = Weights::new(history.collection(), window, window);
    let task = Task {
        memory_bytes: MEMORY_BYTES,
        ..Task::new(history, grid, &weights)
    };
    match former.form(&task) {
        Ok(formed) => {
            let finite = formed.image.pixels.iter().all(|z| z.is_finite());
            assert!(
                finite,
                "{} formed an image that is not finite",
                former.name()
            );
            former.name().to_owned()
        }
        Err(error) => error.to_string(),
    }
}

/// Write the recording and read it again: the samples, frequencies and times are the same bits. Only for one input in four, because files
/// are slow.
fn written_again(history: &dyn PhaseHistory, path: &std::path::Path, bytes: &[u8]) -> String {
    if choice(bytes, 4) > 0 {
        return String::new();
    }
    let Ok(before) = samples(history) else {
        return String::new();
    };
    let channel = Channel::new("1", history);
    if let Err(error) = write(path, &[channel], &WriteOptions::default(), &Silent) {
        return error.to_string();
    }
    let again = Cphd::open(path, None, u64::MAX).expect("written recordings are read");
    let (one, two) = (history.collection(), again.collection());
    assert_eq!(one.pulses.len(), two.pulses.len());
    let bits = |samples: &[Complex32]| -> Vec<_> {
        samples
            .iter()
            .map(|z| (z.re.to_bits(), z.im.to_bits()))
            .collect()
    };
    assert_eq!(
        bits(&before),
        bits(&samples(&again).expect("samples are read again"))
    );
    for (one, two) in one.pulses.iter().zip(&two.pulses) {
        let numbers =
            |pulse: &Pulse| [pulse.time_s, pulse.start_hz, pulse.step_hz].map(f64::to_bits);
        assert_eq!(numbers(one), numbers(two));
    }
    "written".to_owned()
}
