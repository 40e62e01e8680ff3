//! Files of a case, made once and read by every measurement, of our formers and other programs.
//!
//! A folder of `target/bench`, named after the case and the version of the format:
//!
//! | file | content |
//! |---|---|
//! | `samples.npy` | complex64 `[pulse][sample]` |
//! | `antennas.npy` | float64 `[pulse][x, y, z]`, metres; phases are referred to the scene's middle, `(0, 0, 0)` |
//! | `weights-fast.npy`, `weights-slow.npy` | float64 windows over samples and pulses |
//! | `case.json` | `start_hz`, `step_hz`, `side` and `pixel_m` of the image, which is about the middle |
//! | `judged-SIDE.npy` | float64 `[place][row, column, real, imaginary, stands for]`: the image of `SIDE` x `SIDE` pixels at some pixels, and the number of pixels that each represents |
//!
//! Folders and files of judged pixels are complete or absent.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::json;
use subaperture::io::npy::{Array, ArrayWriter, Number, Values};
use subaperture::num_complex::{Complex32, Complex64};
use subaperture::phase_history::{Collection, InMemory, Weights};
use subaperture::signal::window::Window;
use subaperture_tests::digest;

use crate::case::Case;
use crate::sums;

/// Version of the format; each has a separate folder.
const FORMAT: u32 = 2;

/// A pixel of the image with its exact value.
#[derive(Clone, Copy)]
pub(crate) struct Judged {
    pub(crate) row: usize,
    pub(crate) column: usize,
    pub(crate) value: Complex64,
    /// Number of pixels that it represents.
    pub(crate) stands_for: f64,
}

/// Folder of the benchmark's files.
pub(crate) fn place() -> PathBuf {
    subaperture_xtask::target_folder().join("bench")
}

/// The case's folder.
fn folder(case: &Case) -> PathBuf {
    let hash = digest(format!("{FORMAT} {case:?}").into_bytes());
    place().join(format!("{}-{:08x}", case.name, hash >> 32))
}

/// The windows of all cases.
fn weights(collection: &Collection) -> Weights {
    Weights::new(collection, Window::Hamming, Window::Hamming)
}

/// The case's folder, made if it is missing.
///
/// # Errors
/// Faults of the files.
pub(crate) fn ready(case: &Case) -> Result<PathBuf, String> {
    let folder = folder(case);
    if !folder.is_dir() {
        eprintln!("case {case}: simulating {} scatterers", case.scatterers);
        write(case, &folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    Ok(folder)
}

fn write(case: &Case, folder: &Path) -> io::Result<()> {
    let new = folder.with_extension(format!("new-{}", std::process::id()));
    fs::create_dir_all(&new)?;
    let collection = case.collection();
    let scene = sums::scatterers(case.scatterers, case.scene_m);
    let file = fs::File::create(new.join("samples.npy"))?;
    let mut samples = ArrayWriter::new(file, &[case.pulses, case.samples])?;
    for run in case.runs() {
        samples.put(&sums::samples(
            &collection.pulses[run],
            case.samples,
            &scene,
        ))?;
    }
    samples.finish()?;
    let antennas = collection.pulses.iter();
    let antennas: Vec<f64> = antennas.flat_map(|p| p.transmitter_m.to_array()).collect();
    write_array(&new.join("antennas.npy"), &[case.pulses, 3], &antennas)?;
    let weights = weights(&collection);
    for (name, weights) in [("fast", &weights.fast), ("slow", &weights.slow)] {
        let path = new.join(format!("weights-{name}.npy"));
        write_array(&path, &[weights.len()], weights)?;
    }
    let about = json!({
        "start_hz": case.start_hz,
        "step_hz": case.step_hz,
        "side": case.side,
        "pixel_m": case.pixel_m,
    });
    fs::write(new.join("case.json"), about.to_string())?;
    // Another process may have been faster.
    fs::rename(&new, folder).or_else(|error| match folder.is_dir() {
        true => fs::remove_dir_all(&new),
        false => Err(error),
    })
}

fn write_array<T: Number>(path: &Path, shape: &[usize], values: &[T]) -> io::Result<()> {
    let mut writer = ArrayWriter::new(fs::File::create(path)?, shape)?;
    writer.put(values)?;
    writer.finish()?;
    Ok(())
}

/// The case's samples.
///
/// # Errors
/// Errors of reading the file.
fn samples(folder: &Path) -> Result<Vec<Complex32>, String> {
    let path = folder.join("samples.npy");
    let array = Array::read(&path, None, u64::MAX).map_err(|error| error.to_string())?;
    match array.values {
        Values::Complex(samples) => Ok(samples),
        Values::Real(_) => Err(format!("{}: not complex", path.display())),
    }
}

/// Phase history and weights of a case.
///
/// # Errors
/// Errors of reading the files.
pub(crate) fn history(case: &Case, folder: &Path) -> Result<(InMemory, Weights), String> {
    let collection = case.collection();
    let weights = weights(&collection);
    let history = InMemory::new(collection, samples(folder)?).map_err(|error| error.to_string())?;
    Ok((history, weights))
}

fn judged_file(folder: &Path, side: usize) -> PathBuf {
    folder.join(format!("judged-{side}.npy"))
}

/// Make the file of judged pixels of an image of `side` x `side` pixels if it is missing.
///
/// # Errors
/// Errors of reading the files.
pub(crate) fn judge(case: &Case, folder: &Path, side: usize) -> Result<(), String> {
    let path = judged_file(folder, side);
    if path.is_file() {
        return Ok(());
    }
    let places = case.judged(side);
    eprintln!(
        "case {}: the float64 sum at {} pixels",
        case.name,
        places.len()
    );
    let grid = case.grid(side);
    let points_m: Vec<_> = places
        .iter()
        .map(|place| grid.position_m(place.row, place.column))
        .collect();
    let values = values_at(case, folder, &points_m)?;
    let lines = places.iter().zip(values);
    let lines: Vec<f64> = lines
        .flat_map(|(place, value)| {
            let [row, column] = [place.row, place.column].map(|i| i as f64);
            [row, column, value.re, value.im, place.stands_for]
        })
        .collect();
    let new = path.with_extension(format!("new-{}", std::process::id()));
    write_array(&new, &[places.len(), 5], &lines)
        .and_then(|()| fs::rename(&new, &path))
        .map_err(|error| format!("{}: {error}", path.display()))
}

/// The float64 sum at points.
fn values_at(
    case: &Case,
    folder: &Path,
    points_m: &[subaperture::glam::DVec3],
) -> Result<Vec<Complex64>, String> {
    let collection = case.collection();
    let weights = weights(&collection);
    Ok(sums::image(
        &collection,
        &samples(folder)?,
        &weights,
        points_m,
    ))
}

/// Write the float64 sum, `[point][real, imaginary]`, at the points of a file, `[point][x, y, z]`.
///
/// # Errors
/// Errors of writing the files.
pub(crate) fn sum_at(case: &Case, points: &Path, values: &Path) -> Result<(), String> {
    let points_m = real(points)?;
    let points_m: Vec<_> = points_m
        .chunks_exact(3)
        .map(subaperture::glam::DVec3::from_slice)
        .collect();
    let sums = values_at(case, &ready(case)?, &points_m)?;
    let numbers: Vec<f64> = sums.iter().flat_map(|z| [z.re, z.im]).collect();
    write_array(values, &[sums.len(), 2], &numbers)
        .map_err(|error| format!("{}: {error}", values.display()))
}

fn real(path: &Path) -> Result<Vec<f64>, String> {
    let array = Array::read(path, None, u64::MAX).map_err(|error| error.to_string())?;
    match array.values {
        Values::Real(numbers) => Ok(numbers),
        Values::Complex(_) => Err(format!("{}: complex", path.display())),
    }
}

/// Judged pixels of an image.
///
/// # Errors
/// Errors of writing the file.
pub(crate) fn judged(folder: &Path, side: usize) -> Result<Vec<Judged>, String> {
    let numbers = real(&judged_file(folder, side))?;
    let judged = numbers.chunks_exact(5).map(|line| Judged {
        row: line[0] as usize,
        column: line[1] as usize,
        value: Complex64::new(line[2], line[3]),
        stands_for: line[4],
    });
    Ok(judged.collect())
}
