//! Half-wavelength slips of an estimated track.
//!
//! A displacement of half a wavelength along the line of sight changes the phase of an echo by a whole turn, which is invisible in an image. An estimate
//! follows the phase from pulse to pulse and can lose a turn between two pulses. The image is then sharp and all parts of the data agree, but the track is
//! wrong by half a wavelength from that pulse on. A track with a change of the two-way phase of more than [`MAX_STEP_RAD`] between two
//! neighbouring pulses is therefore refused.
//!
//! Tracks of far scenes have a smaller limit (`far.rs`).

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_model::resolution::support::path_gradient;

use super::echoes::wavenumber_rad_m;

/// Largest accepted change of the two-way phase from pulse to pulse, radians: half a turn. A true change below it exceeds it if a turn is lost.
pub const MAX_STEP_RAD: f64 = std::f64::consts::PI;

/// Largest change from pulse to pulse, radians, of the two-way phase by the displacements, for echoes from the grid's centre and corners.
pub(crate) fn largest_step_rad(
    collection: &Collection,
    grid: &ImageGrid,
    displacement_m: &[DVec3],
) -> f64 {
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let places_m = [
        (rows / 2, columns / 2),
        (0, 0),
        (0, columns - 1),
        (rows - 1, 0),
        (rows - 1, columns - 1),
    ]
    .map(|(row, column)| grid.position_m(row, column));
    let turns = collection.num_turns();
    let channels = collection.pulses.chunks(turns);
    channels
        .zip(displacement_m.chunks(turns))
        .flat_map(|(pulses, moved_m)| pulses[1..].iter().zip(moved_m.windows(2)))
        .flat_map(|(pulse, moved_m)| {
            let step_m = moved_m[1] - moved_m[0];
            places_m.map(|place_m| {
                let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, place_m);
                (wavenumber_rad_m(collection, pulse) * gradient.dot(step_m)).abs()
            })
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use subaperture_model::geometry::{Axis, SceneFrame};
    use subaperture_model::phase_history::{Pulse, Sweep};

    use super::*;

    #[test]
    fn step_is_change_of_two_way_phase_within_channel() {
        let pulse = |n: u32| {
            let at_m = DVec3::new(0.01 * f64::from(n), 0.0, 0.0);
            Pulse {
                time_s: f64::from(n % 4),
                transmitter_m: at_m,
                receiver_m: at_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 0.0,
                start_hz: 10e9,
                step_hz: 0.0,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        let collection = Collection {
            name: "line".to_owned(),
            num_samples: 1,
            pulses: (0..4).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let axis = |start| Axis {
            start,
            step: 1.0,
            count: 1,
        };
        let grid = ImageGrid::horizontal(axis(0.0), axis(1e4), 0.0);
        // 3 mm towards the point at 10 GHz: 4 pi 0.003 / 0.02998. A shift common to all pulses is not a step.
        let moved = [0.0, 0.0, 0.003, 0.003].map(|y| DVec3::new(0.0, 0.1 + y, 0.0));
        let step_rad = largest_step_rad(&collection, &grid, &moved);
        let expected = 4.0 * std::f64::consts::PI * 0.003 * 10e9 / 299_792_458.0;
        assert!((step_rad - expected).abs() < 1e-6, "{step_rad} {expected}");
        // Displacements across the line of sight change no phase; 3 cm of track at 10 km rotate the line of sight by 3e-6 rad.
        let across = [0.0, 0.0, 0.003, 0.003].map(|x| DVec3::new(x, 0.0, 0.0));
        assert!(largest_step_rad(&collection, &grid, &across) < 1e-5 * expected);
    }
}
