//! Passes in memory: images on one grid, times, wavelength, position of the radar.

use anyhow::{anyhow, bail};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::{Image, ImageSource as _};
use subaperture::images::OpenImage;
use subaperture::interferometry::displacement::Settings;
use subaperture::io::product::Antennas;

use crate::args::{Displacement, PairFormat};
use crate::commands::stored;
use crate::config::Session;
use crate::failure::Usage;
use crate::{messages, text};

/// Largest distance between the apertures of two passes for which heights of points give no phase, wavelengths.
const SAME_APERTURE: f64 = 0.1;

/// Largest relative difference of wavelengths: some 1e-3 rad over 100 wavelengths of displacement.
const SAME_WAVELENGTH: f64 = 1e-6;

/// Passes sorted by time, earliest first.
pub(super) struct Read {
    pub(super) opened: Vec<OpenImage>,
    pub(super) images: Vec<Image>,
    /// Times relative to the first pass, seconds.
    pub(super) times_s: Vec<f64>,
    /// Starts of the recordings, nanoseconds since 1970; empty unless all are recorded.
    pub(super) start_ns: Vec<i64>,
    pub(super) grid: ImageGrid,
    pub(super) frame: SceneFrame,
    pub(super) radar_m: [f64; 3],
    pub(super) wavelength_m: f64,
    /// Largest number of points within the memory budget.
    pub(super) most_points: usize,
}

/// Acquisition of a pass as recorded.
struct Acquisition {
    wavelength_m: f64,
    radar_m: [f64; 3],
    start_ns: Option<i64>,
    /// Middle of the pass relative to its start, seconds.
    middle_s: f64,
}

impl Acquisition {
    fn of(image: &OpenImage) -> anyhow::Result<Self> {
        let record = image.record.as_ref();
        let wavelength_m = record.and_then(|r| r["collection"]["wavelength_m"].as_f64());
        let antennas = record.and_then(|r| Antennas::of_json(&r["antennas"]));
        let (Some(wavelength_m), Some(antennas), Some(_)) = (wavelength_m, antennas, image.grid())
        else {
            bail!(
                "{}: expected an image whose record states grid, wavelength and antenna positions: give products of subap focus, or a Zarr stack of them",
                image.path.display()
            );
        };
        let positions = || antennas.transmitters_m.iter().chain(&antennas.receivers_m);
        let count = positions().count().max(1) as f64;
        let radar_m = positions().fold([0.0; 3], |sum: [f64; 3], at| {
            let at = at.to_array();
            [0, 1, 2].map(|i| sum[i] + at[i] / count)
        });
        let ends = antennas.times_s.first().zip(antennas.times_s.last());
        let ends = ends.filter(|_| antennas.timed);
        Ok(Self {
            wavelength_m,
            radar_m,
            // Writers without a date state the beginning of 1970.
            start_ns: antennas.start_ns.filter(|&start_ns| start_ns != 0),
            middle_s: ends.map_or(0.0, |(first, last)| 0.5 * (first + last)),
        })
    }
}

impl Read {
    /// Read all passes and sort them by time.
    pub(super) fn new(session: &Session, typed: &Displacement) -> anyhow::Result<Self> {
        if let Some(times) = &typed.times
            && times.0.len() != typed.passes.len()
        {
            let fault = format!(
                "--times: expected a time for each of {} passes, found {}",
                typed.passes.len(),
                times.0.len()
            );
            return Err(Usage(fault).into());
        }
        let mut opened: Vec<OpenImage> = Vec::new();
        let mut acquired = Vec::new();
        for path in &typed.passes {
            let image = stored::open(session, path)?;
            let image = match &typed.place {
                Some(place) if image.is_unplaced() => image.placed(place),
                _ => image,
            };
            stored::check_complex(&image)?;
            let acquisition = Acquisition::of(&image)?;
            if let Some(first) = opened.first() {
                stored::check_same_pixels(first, &image)?;
            }
            acquired.push(acquisition);
            opened.push(image);
        }
        let most_points = most_points(session, typed, &opened[0])?;
        let times_s = times(typed, &opened, &acquired)?;
        check_acquisitions(&opened, &acquired)?;
        let mut order: Vec<usize> = (0..opened.len()).collect();
        order.sort_by(|&a, &b| times_s[a].total_cmp(&times_s[b]));
        for pair in order.windows(2) {
            let [before, after] = [pair[0], pair[1]];
            if times_s[before] == times_s[after] {
                bail!(
                    "{} and {} have the same time: expected each pass once; give other images, or --times",
                    opened[before].path.display(),
                    opened[after].path.display()
                );
            }
        }
        let first_s = times_s[order[0]];
        let starts: Option<Vec<i64>> = order.iter().map(|&n| acquired[n].start_ns).collect();
        let mut sorted: Vec<(usize, OpenImage)> = opened.into_iter().enumerate().collect();
        sorted.sort_by_key(|&(n, _)| order.iter().position(|&at| at == n));
        let opened: Vec<OpenImage> = sorted.into_iter().map(|(_, image)| image).collect();
        let images: anyhow::Result<Vec<Image>> = opened
            .iter()
            .map(|image| stored::whole(&image.pixels))
            .collect();
        let (grid, frame) = stored::grid(&opened[0]);
        Ok(Self {
            most_points,
            images: images?,
            opened,
            times_s: order.iter().map(|&n| times_s[n] - first_s).collect(),
            start_ns: starts.unwrap_or_default(),
            grid,
            frame,
            radar_m: acquired[order[0]].radar_m,
            wavelength_m: acquired[order[0]].wavelength_m,
        })
    }
}

/// Time of each pass in the order of the command line, seconds.
fn times(
    typed: &Displacement,
    opened: &[OpenImage],
    acquired: &[Acquisition],
) -> anyhow::Result<Vec<f64>> {
    if let Some(times) = &typed.times {
        return Ok(times.0.clone());
    }
    // Nanoseconds since 1970 exceed the digits of float64.
    let origin = acquired[0].start_ns.unwrap_or_default();
    let time = |(image, acquisition): (&OpenImage, &Acquisition)| match acquisition.start_ns {
        Some(start_ns) => Ok(1e-9 * (start_ns - origin) as f64 + acquisition.middle_s),
        None => Err(anyhow!(
            "{}: expected a recorded date, found none: give the times of all passes with --times, for example --times 0,6h,12h",
            image.path.display()
        )),
    };
    opened.iter().zip(acquired).map(time).collect()
}

/// Refuse different wavelengths, and warn of apertures at different places.
fn check_acquisitions(opened: &[OpenImage], acquired: &[Acquisition]) -> anyhow::Result<()> {
    let first = &acquired[0];
    for (image, other) in opened.iter().zip(acquired).skip(1) {
        let ratio = other.wavelength_m / first.wavelength_m - 1.0;
        if ratio.is_nan() || ratio.abs() > SAME_WAVELENGTH {
            bail!(
                "{} has a wavelength of {} m, {} of {} m: expected repeat passes of one radar",
                opened[0].path.display(),
                first.wavelength_m,
                image.path.display(),
                other.wavelength_m
            );
        }
        let squares = (0..3).map(|i| (other.radar_m[i] - first.radar_m[i]).powi(2));
        let baseline_m = squares.sum::<f64>().sqrt();
        if baseline_m > SAME_APERTURE * first.wavelength_m {
            messages::warning(format!(
                "{}: the centre of the aperture lies {:.4} m from that of {}: heights of points above the grid's surface give phases that count as displacement",
                image.path.display(),
                baseline_m,
                opened[0].path.display()
            ));
        }
    }
    Ok(())
}

/// Largest number of points within the budget; fail if the passes alone exceed it.
fn most_points(
    session: &Session,
    typed: &Displacement,
    first: &OpenImage,
) -> anyhow::Result<usize> {
    let (rows, columns) = first.pixels.size();
    let passes = typed.passes.len();
    // Images; mean power and numbers of pixels, or maps; displacement and deviation of each pass.
    let stack = match typed.formats.contains(&PairFormat::Zarr) {
        true => 8 * passes as u128 + 12,
        false => 0,
    };
    let bytes = (8 * passes as u128 + 48 + stack) * rows as u128 * columns as u128;
    let Some(left) = u128::from(session.memory_bytes).checked_sub(bytes) else {
        bail!(
            "{passes} passes of {rows} x {columns} pixels need {}; --memory allows {}: raise --memory or form smaller images",
            text::bytes(bytes),
            text::bytes(session.memory_bytes.into())
        );
    };
    let points = left / u128::from(Settings::point_bytes(passes));
    Ok(usize::try_from(points).unwrap_or(usize::MAX))
}
