//! Code shared by the integration tests.
#![forbid(unsafe_code)]

pub mod accuracy_table;
pub mod dem;
pub mod dpca_scene;
pub mod experiment;
pub mod faults;
pub mod firmware;
pub mod front_end;
pub mod fuzz;
pub mod gotcha_gmti;
pub mod link_recording;
pub mod link_scene;
pub mod maps;
pub mod matlab;
pub mod module;
pub mod module_report;
pub mod numpy;
pub mod odometer_scene;
pub mod orbit_strip;
pub mod plain_history;
pub mod plain_sum;
pub mod python;
pub mod random;
pub mod simulated_vna;
pub mod statistics;
pub mod stream_scene;
pub mod subap;
pub mod sweep_scene;
pub mod tiny_disk;

use subaperture::image::Image;

/// FNV-1a, 64 bits.
pub fn digest(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Relative RMS error of `image` against `reference`, dB, independent of the library's comparison.
///
/// # Panics
/// If the images differ in size.
pub fn error_db(image: &Image, reference: &Image) -> f64 {
    assert_eq!(
        (image.rows, image.columns),
        (reference.rows, reference.columns)
    );
    let (mut error, mut power) = (0.0, 0.0);
    for (a, b) in image.pixels.iter().zip(&reference.pixels) {
        error += f64::from((a - b).norm_sqr());
        power += f64::from(b.norm_sqr());
    }
    10.0 * (error / power).log10()
}
