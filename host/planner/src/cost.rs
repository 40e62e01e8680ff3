//! Memory and operations of the image formers.
//!
//! [`ThesisMemory`] counts as Schone 2020, 5.2: complex float64 (16 bytes), range padded tenfold.
//!
//! ```text
//! profile 16 (10 K)      map 16 (10 K) D      image 16 P      range and Doppler 2 8 P      line of sight 3 16 P
//! ```
//!
//! The last is his "nearly 20 GB" for 400 million pixels: 19.2 GB at 16 bytes a component. As real numbers,
//! which they are, a vector takes 9.6 GB; so counted, 20 GB hold it and the pixels' positions.
//!
//! [`Cost`] is ours, in complex float32, by the formers' own documentation, with `P` pixels, `N` pulses of `K`
//! frequencies. Operations are real additions, multiplications, roots (one each) and phasors (20); a transform
//! of `n` is `5 n log2 n`.
//!
//! ```text
//! exact    a pixel, pulse and frequency: a multiplication and an addition, complex                   8
//! bp       a pixel and pulse: path 11, place 3, linear reading 6, phasor 21, sum 8               49
//!          a pulse: a transform of the upsampled profile
//! thesis   a pixel and sub-CPI: path and rate 34, place 5, bilinear 18, phasor 23, sum 8          88
//!          a sub-CPI: Keystone 4 K M^2, K transforms of 16 M, 16 M transforms of 10 K
//! precise  a pixel and sub-CPI: two paths 22, place 5, kernel 8 W + 4 W^2, phasor 21, sum 8       56 + 8 W + 4 W^2
//!          a patch and sub-CPI: compensation 8 M K, 2 K transforms of M + D, D transforms of 2 K
//! rda      [Sizes], with L padded pulses, Q wavenumbers along the track, R ranges: K transforms of L, R of 2 Q,
//!          40 a pixel; Q transforms of 2 K, 44 a wavenumber and range
//! omega-k  as rda, but Q transforms of 2 R, 44 a wavenumber and frequency
//! pfa      [RasterSize]: 4 W^2 a sample, a transform over each axis of the raster; a pixel: 16 two-way paths 22, a
//!          phasor 20, reading 4 W^2
//! ffbp     at the least: 6 W a sample and level, and backprojection's 49 for 4 W pulses a pixel
//! ```
//!
//! The last four are by their modules' own accounts, which are rougher than the first three's: a quarter either
//! way. rda and omega-k need a straight track, and are left out without one.
//!
//! Neglected: reading files, tables made once. Counts are not times: a map's transforms run at several times the
//! speed of scattered reads. Transform lengths are not rounded up to fast ones (a few per cent).

use serde::Serialize;

use subaperture_focus::pfa::{FIT_PULSES, RasterSize};
use subaperture_focus::strip::Sizes;
use subaperture_focus::{MARGIN_DB, rdbp};
use subaperture_signal::range_profile::RangeProfiler;

/// Range upsampling of the thesis.
const THESIS_RANGE_PADDING: usize = 10;
/// Doppler upsampling of our thesis's mode.
const THESIS_DOPPLER_PADDING: usize = 16;
/// Pulses whose profiles `bp` holds at once.
const PROFILES: usize = 64;
/// Pulses that `rdbp` holds at once, or a sub-CPI's if more.
const BLOCK_PULSES: usize = 4096;

/// Bytes as the thesis counts them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ThesisMemory {
    /// An upsampled range profile: all that backprojection holds beside the image.
    pub profile_bytes: u128,
    /// A range-Doppler map.
    pub map_bytes: u128,
    /// The image.
    pub image_bytes: u128,
    /// Range and Doppler of every pixel.
    pub range_and_doppler_bytes: u128,
    /// Line of sight to every pixel.
    pub line_of_sight_bytes: u128,
}

impl ThesisMemory {
    /// For `frequencies` a pulse, maps padded to `doppler_length`, and `pixels`.
    pub fn new(frequencies: usize, doppler_length: usize, pixels: u64) -> Self {
        let profile_bytes = 16 * THESIS_RANGE_PADDING as u128 * frequencies as u128;
        let pixels = u128::from(pixels);
        Self {
            profile_bytes,
            map_bytes: profile_bytes * doppler_length as u128,
            image_bytes: 16 * pixels,
            range_and_doppler_bytes: 2 * 8 * pixels,
            line_of_sight_bytes: 3 * 16 * pixels,
        }
    }
}

/// The work to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Frequencies a pulse.
    pub frequencies: usize,
    /// Pulses.
    pub pulses: usize,
    /// Pixels.
    pub pixels: u64,
}

/// What one former takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Its name.
    pub algorithm: &'static str,
    /// Buffers and their bytes, one thread's.
    pub memory: Vec<Buffer>,
    /// Sum of the buffers.
    pub total_bytes: u128,
    /// Real operations for the image.
    pub operations: f64,
    /// Operations for each pixel and pulse.
    pub per_pixel_and_pulse: f64,
}

/// A buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Buffer {
    /// What it holds.
    pub name: &'static str,
    /// Its size.
    pub bytes: u128,
}

/// A transform's operations.
fn transform(length: f64) -> f64 {
    5.0 * length * length.max(2.0).log2()
}

impl Cost {
    fn new(
        algorithm: &'static str,
        work: &Work,
        memory: &[(&'static str, f64)],
        operations: f64,
    ) -> Self {
        let image = ("image", 8.0 * work.pixels as f64);
        let memory: Vec<Buffer> = std::iter::once(&image)
            .chain(memory)
            .map(|&(name, bytes)| Buffer {
                name,
                bytes: bytes as u128,
            })
            .collect();
        Self {
            algorithm,
            total_bytes: memory.iter().map(|buffer| buffer.bytes).sum(),
            memory,
            operations,
            per_pixel_and_pulse: operations / (work.pixels as f64 * work.pulses as f64),
        }
    }

    /// The exact sum.
    pub fn exact(work: &Work) -> Self {
        let (k, n) = (work.frequencies as f64, work.pulses as f64);
        let pixels = work.pixels as f64;
        let memory = [("points and sums", 40.0 * pixels)];
        Self::new("exact", work, &memory, 8.0 * pixels * n * k)
    }

    /// Backprojection within an error bound of `error_db`.
    pub fn backprojection(work: &Work, error_db: f64) -> Self {
        let upsampling = RangeProfiler::oversampling_for(error_db - MARGIN_DB);
        let (k, n) = (work.frequencies as f64, work.pulses as f64);
        let length = upsampling * k;
        let held = n.min(PROFILES as f64);
        let operations = 49.0 * work.pixels as f64 * n + n * transform(length);
        let memory = [("profiles", 8.0 * held * (k + length))];
        Self::new("bp", work, &memory, operations)
    }

    /// The thesis's mode with sub-CPIs of `sub_cpi` pulses.
    pub fn thesis(work: &Work, sub_cpi: usize) -> Self {
        let (k, m) = (work.frequencies as f64, sub_cpi as f64);
        let sub_cpis = work.pulses.div_ceil(sub_cpi.max(1)) as f64;
        let doppler = THESIS_DOPPLER_PADDING as f64 * m;
        let range = THESIS_RANGE_PADDING as f64 * k;
        let map = 4.0 * k * m * m + k * transform(doppler) + doppler * transform(range);
        let operations = sub_cpis * (map + 88.0 * work.pixels as f64);
        let memory = [
            ("map", 8.0 * doppler * (range + k)),
            ("Keystone weights", 4.0 * k * m * m),
            ("a sub-CPI", 8.0 * k * m),
        ];
        Self::new("rdbp, thesis", work, &memory, operations)
    }

    /// The precise mode as planned, with `doppler_span` cycles a pulse across a patch and `patches` patches.
    pub fn precise(work: &Work, plan: &rdbp::Plan, doppler_span: f64, patches: usize) -> Self {
        let (k, m) = (work.frequencies as f64, plan.sub_cpi_length as f64);
        let sub_cpis = plan.sub_cpis.len() as f64;
        let taps = plan.taps as f64;
        let highest = plan.band.frequency_hz(plan.band.count - 1) / plan.band.centre_hz();
        // Twice Nyquist's bins, a tenth more, and the kernel's reach.
        let bins = (2.2 * m * highest.max(1.0) * doppler_span).ceil() + taps + 3.0;
        let map = 8.0 * m * k + 2.0 * k * transform(m + bins) + bins * transform(2.0 * k);
        let pixel = 56.0 + 8.0 * taps + 4.0 * taps * taps;
        let operations = sub_cpis * (patches as f64 * map + pixel * work.pixels as f64);
        let held = (BLOCK_PULSES.min(work.pulses) as f64).max(m);
        let memory = [
            ("map", 8.0 * (bins * (2.0 * k + taps) + m * k)),
            ("Doppler tables", 8.0 * k * 2.0 * (m + bins)),
            ("pulses", 8.0 * held * k),
        ];
        Self::new("rdbp", work, &memory, operations)
    }

    /// The range-Doppler algorithm with arrays of `sizes`.
    pub fn range_doppler_algorithm(work: &Work, sizes: &Sizes) -> Self {
        let (k, q) = (work.frequencies as f64, sizes.along_wavenumbers as f64);
        // Six real multiply-adds and a phasor.
        let own = q * transform(2.0 * k) + 44.0 * q * sizes.ranges as f64;
        Self::of_strip("rda", work, sizes, own)
    }

    /// Omega-K with arrays of `sizes`.
    pub fn omega_k(work: &Work, sizes: &Sizes) -> Self {
        let (k, q) = (work.frequencies as f64, sizes.along_wavenumbers as f64);
        let own = q * transform(2.0 * sizes.ranges as f64) + 44.0 * k * q;
        Self::of_strip("omega-k", work, sizes, own)
    }

    fn of_strip(algorithm: &'static str, work: &Work, sizes: &Sizes, own: f64) -> Self {
        let (k, n) = (work.frequencies as f64, work.pulses as f64);
        let (q, r) = (sizes.along_wavenumbers as f64, sizes.ranges as f64);
        let operations = k * transform(sizes.padded_pulses as f64)
            + r * transform(sizes.along_length as f64)
            + 40.0 * work.pixels as f64
            + own;
        // Two arrays at a time, one made from the other.
        let steps = [k * (n + q), q * (k + r), r * (q + sizes.columns as f64)];
        let most = steps.into_iter().fold(0.0, f64::max);
        let memory = [("two-dimensional spectrum", 8.0 * most)];
        Self::new(algorithm, work, &memory, operations)
    }

    /// Polar format on a raster of `size`.
    pub fn polar_format(work: &Work, size: &RasterSize) -> Self {
        let samples = work.frequencies as f64 * work.pulses as f64;
        let reading = 4.0 * (size.taps * size.taps) as f64;
        let [rows, lengths] = [size.cells, size.lengths].map(|n| n.map(|n| n as f64));
        let transforms =
            rows[0] * transform(lengths[1]) + size.kept[1] as f64 * transform(lengths[0]);
        let pixel = 22.0 * FIT_PULSES as f64 + 20.0 + reading;
        let operations = reading * samples + transforms + pixel * work.pixels as f64;
        let memory = [("raster", size.bytes() as f64)];
        Self::new("pfa", work, &memory, operations)
    }

    /// Fast factorised backprojection with kernels of `taps` and so many `levels`, all pulses held at once.
    pub fn fast_factorised(work: &Work, taps: usize, levels: usize) -> Self {
        let samples = work.frequencies as f64 * work.pulses as f64;
        let taps = taps as f64;
        let last = (4.0 * taps).min(work.pulses as f64);
        let operations = 6.0 * taps * levels as f64 * samples + 49.0 * last * work.pixels as f64;
        let memory = [
            ("pulses", 8.0 * samples),
            ("patches' pulses", 32.0 * samples),
        ];
        Self::new("ffbp", work, &memory, operations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn section_5_2_is_reproduced() {
        // 21,232 frequencies x 10 = 212,320 bins of 16 bytes: "about 3.4 MB"; by 512: 1.74 GB; by 8192: 27.83 GB;
        // 400 million pixels: 6.4 GB, 6.4 GB, "nearly 20 GB".
        let short = ThesisMemory::new(21_232, 512, 400_000_000);
        assert_eq!(short.profile_bytes, 3_397_120);
        assert_eq!(short.map_bytes, 1_739_325_440);
        assert_eq!(short.image_bytes, 6_400_000_000);
        assert_eq!(short.range_and_doppler_bytes, 6_400_000_000);
        assert_eq!(short.line_of_sight_bytes, 19_200_000_000);
        let long = ThesisMemory::new(21_232, 8192, 400_000_000);
        assert_eq!(long.map_bytes, 27_829_207_040);
    }

    #[test]
    fn long_sub_cpis_save_reading_and_large_images_save_maps() {
        let work = Work {
            frequencies: 256,
            pulses: 1040,
            pixels: 100_000_000,
        };
        let bp = Cost::backprojection(&work, -60.0);
        // So many pixels that profiles and maps count for nothing: 49 a pixel and pulse, 88 / M for the thesis's.
        assert!((bp.per_pixel_and_pulse / 49.0 - 1.0).abs() < 0.01, "{bp:?}");
        let thesis = Cost::thesis(&work, 40);
        assert!(
            (thesis.per_pixel_and_pulse / (88.0 / 40.0) - 1.0).abs() < 0.2,
            "{thesis:?}"
        );
        assert_eq!(bp.memory[0].bytes, 800_000_000);
        // The map: 640 by 2816 complex float32.
        assert_eq!(thesis.memory[1].bytes, 640 * 2816 * 8);
        assert_eq!(
            thesis.total_bytes,
            800_000_000 + 640 * 2816 * 8 + 4 * 256 * 1600 + 8 * 256 * 40
        );
    }
}
