//! Recordings of the tests, images of them by the library, and the GOTCHA recording where it is present.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use subaperture::Focusing;
use subaperture::focus::formers::former;
use subaperture::geometry::ImageGrid;
use subaperture::io::cphd::{self, Channel, WriteOptions};
use subaperture::io::npy::{self, ArrayWriter, Number};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture::simulate::{Preset, Variation};
use subaperture_wasm::request::{Grid, Request};
use subaperture_xtask::root;

/// Write a simulated recording of 41 points as CPHD.
pub(crate) fn write_cphd(path: &Path) {
    let history = Preset::Table41.simulate(&Variation::default());
    let channels = [Channel::new("1", &history)];
    cphd::write(path, &channels, &WriteOptions::default(), &Silent).unwrap();
}

/// Write the same recording as an archive of arrays.
pub(crate) fn write_npz(path: &Path) {
    let history = Preset::Table41.simulate(&Variation::default());
    let collection = history.collection();
    let [pulses, samples] = [collection.pulses.len(), collection.num_samples];
    let mut echoes = vec![Default::default(); pulses * samples];
    history.read(0..pulses, &mut echoes).unwrap();
    let each = |of: &dyn Fn(&subaperture::phase_history::Pulse) -> f64| -> Vec<f64> {
        collection.pulses.iter().map(of).collect()
    };
    let antennas: Vec<f64> = (collection.pulses.iter())
        .flat_map(|pulse| pulse.transmitter_m.to_array())
        .collect();
    let references: Vec<f64> = (collection.pulses.iter())
        .flat_map(|pulse| pulse.reference_m.to_array())
        .collect();
    let mut archive = zip::ZipWriter::new(File::create(path).unwrap());
    add(&mut archive, "samples", &[pulses, samples], &echoes);
    add(
        &mut archive,
        "start_hz",
        &[pulses],
        &each(&|pulse| pulse.start_hz),
    );
    add(
        &mut archive,
        "step_hz",
        &[pulses],
        &each(&|pulse| pulse.step_hz),
    );
    add(&mut archive, "antenna_m", &[pulses, 3], &antennas);
    add(
        &mut archive,
        "time_s",
        &[pulses],
        &each(&|pulse| pulse.time_s),
    );
    add(&mut archive, "sign", &[1], &[-1.0]);
    add(&mut archive, "reference_m", &[pulses, 3], &references);
    archive.finish().unwrap();
}

fn add<T: Number>(archive: &mut zip::ZipWriter<File>, name: &str, shape: &[usize], values: &[T]) {
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file(format!("{name}.npy"), options).unwrap();
    let mut bytes = Vec::new();
    let mut writer = ArrayWriter::new(&mut bytes, shape).unwrap();
    writer.put(values).unwrap();
    writer.finish().unwrap();
    archive.write_all(&bytes).unwrap();
}

/// Image of 120 x 96 pixels on which the points lie off the pixels.
pub(crate) fn request(former: &str, portable: bool) -> Request {
    Request {
        grid: Grid {
            centre_m: [0.3, -0.4],
            size_m: [36.0, 24.0],
            pixels: [120, 96],
        },
        former: former.to_owned(),
        error_db: -50.0,
        portable,
    }
}

/// The image of the library as a NumPy file.
pub(crate) fn by_library(history: &dyn PhaseHistory, request: &Request) -> Vec<u8> {
    let Grid {
        centre_m: [x_m, y_m],
        size_m: [width_m, height_m],
        pixels: [columns, rows],
    } = request.grid;
    let text = format!(
        "x={}:{}:{},y={}:{}:{},z=0",
        x_m - width_m / 2.0,
        x_m + width_m / 2.0,
        width_m / columns as f64,
        y_m - height_m / 2.0,
        y_m + height_m / 2.0,
        height_m / rows as f64
    );
    let grid: ImageGrid = text.parse().unwrap();
    let settings = match request.former.as_str() {
        "exact" => serde_json::json!({}),
        _ => serde_json::json!({ "error_db": request.error_db }),
    };
    let former = former(&request.former, &settings).unwrap();
    let focusing = Focusing::new(history, &grid).memory_bytes(1 << 30);
    let focusing = match request.portable {
        true => focusing.portable(),
        false => focusing,
    };
    let mut bytes = Vec::new();
    npy::write_to(&mut bytes, &focusing.by(&*former).unwrap().image).unwrap();
    bytes
}

/// Relative RMS difference of two images in NumPy files, dB.
pub(crate) fn difference_db(image: &[u8], exact: &[u8]) -> f64 {
    let numbers = |bytes: &[u8]| -> Vec<f64> {
        assert!(bytes.starts_with(b"\x93NUMPY"));
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let numbers = bytes[header..].as_chunks().0.iter();
        numbers.map(|&x| f64::from(f32::from_le_bytes(x))).collect()
    };
    let [image, exact] = [image, exact].map(numbers);
    assert_eq!(image.len(), exact.len());
    let error: f64 = image.iter().zip(&exact).map(|(a, b)| (a - b).powi(2)).sum();
    let power: f64 = exact.iter().map(|x| x * x).sum();
    10.0 * (error / power).log10()
}

/// Both degrees of the GOTCHA recording; `None` with a message if they are missing.
pub(crate) fn gotcha() -> Option<Vec<PathBuf>> {
    let folder = root().join("../shared/data/gotcha");
    let paths = [1, 2].map(|i| folder.join(format!("data_3dsar_pass1_az00{i}_HH.mat")));
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        println!("skipped: {} not found", missing.display());
        return None;
    }
    Some(paths.map(|path| path.canonicalize().unwrap()).to_vec())
}
