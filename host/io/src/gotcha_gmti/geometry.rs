//! Geometry and frequencies of a channel's pulses.

use glam::DVec3;

use super::parameters::{Auxiliary, Positions};
use crate::frequencies::MIN_FREQUENCY_HZ;
use crate::gotcha::is_range_of;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{Collection, Pulse, Sweep, misplaced};

/// Samples of a pulse as stored.
pub(super) const SAMPLES: usize = 384;

/// Samples of a pulse before decimation.
const ORIGINAL_SAMPLES: f64 = 5400.0;

/// Pulses from one to the next of the three positions whose parabola gives the direction of the track. Positions stored as float32 are rounded to 0.5 mm
/// near 10 km, which is 1 % of a pulse spacing.
const DIRECTION_PULSES: usize = 32;

/// Pulses of a channel at the recorded positions.
///
/// # Errors
/// Field and fault, if a number is not physical.
pub(super) fn collection(
    name: String,
    channel: &Auxiliary,
    common: &Positions,
    prf_hz: Option<f64>,
) -> Result<Collection, String> {
    let original_step_hz = common.chirp_hz_s / channel.sampling_hz;
    let step_hz = original_step_hz * ORIGINAL_SAMPLES / SAMPLES as f64;
    let bin_m = SPEED_OF_LIGHT_M_S / (2.0 * ORIGINAL_SAMPLES * original_step_hz);
    let antennas: Vec<DVec3> = (common.antennas_m.as_chunks::<3>().0.iter())
        .map(|&[x, y, z]| DVec3::new(x, y, z))
        .collect();
    let by_position = (antennas.iter().zip(&common.ranges_m))
        .all(|(&antenna, &range_m)| is_range_of(range_m, antenna));
    let pulse = |n: usize| {
        let antenna = antennas[n];
        let range_m = match by_position {
            true => antenna.length(),
            false => common.ranges_m[n],
        };
        let shift = channel.shift_errors[n] - channel.shifts[n] + 1.0;
        let start_hz = common.radii_hz[n] + shift * original_step_hz;
        if start_hz < MIN_FREQUENCY_HZ {
            return Err(format!(
                "paux.PHradius of pulse {n}: expected hertz, found {}, which gives a first frequency of {start_hz} Hz",
                common.radii_hz[n]
            ));
        }
        let pulse = Pulse {
            time_s: n as f64 / prf_hz.unwrap_or(1.0),
            transmitter_m: antenna,
            receiver_m: antenna,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * (range_m + channel.range_bins[n] * bin_m),
            start_hz,
            step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        match pulse.fault(SAMPLES) {
            None => Ok(pulse),
            Some(fault) => Err(format!("pulse {n}: {fault}")),
        }
    };
    // Of exactly their number: the memory has been compared with the limit.
    let mut pulses = Vec::with_capacity(antennas.len());
    for n in 0..antennas.len() {
        pulses.push(pulse(n)?);
    }
    Ok(Collection {
        name,
        num_samples: SAMPLES,
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: prf_hz.is_some(),
    })
}

/// Displace the receivers along the track by `offset_m`, positive forwards. The direction at a pulse is that of the parabola through three positions
/// [`DIRECTION_PULSES`] apart. The pulse is the middle one unless the recording begins or ends there. Positions that no vehicle can have had are
/// left out. On a circle the direction is exact in the middle, and off at the ends by a quarter of the cube of the ratio of the three positions' spacing to the radius.
///
/// # Errors
/// Description of a track without a direction.
pub(super) fn displace_receivers(collection: &mut Collection, offset_m: f64) -> Result<(), String> {
    if offset_m == 0.0 {
        return Ok(());
    }
    let left_out = misplaced(collection);
    let pulses = &mut collection.pulses;
    let sound = (0..pulses.len()).filter(|n| !left_out.iter().any(|run| run.contains(n)));
    let sound: Vec<usize> = sound.collect();
    let places: Vec<(f64, DVec3)> = sound
        .iter()
        .map(|&n| (n as f64, pulses[n].transmitter_m))
        .collect();
    for (i, &n) in sound.iter().enumerate() {
        let Some(along) = rate(&places, i).try_normalize() else {
            return Err(format!(
                "receiver_offset: the antenna does not move at pulse {n}, so that no direction is along its track"
            ));
        };
        pulses[n].receiver_m += offset_m * along;
    }
    Ok(())
}

/// Change of position per pulse at entry `i` of pulse numbers and positions.
fn rate(places: &[(f64, DVec3)], i: usize) -> DVec3 {
    let spacing = DIRECTION_PULSES.min((places.len() - 1) / 2);
    if spacing == 0 {
        let (_, last) = places[places.len() - 1];
        return last - places[0].1;
    }
    let first = i
        .saturating_sub(spacing)
        .min(places.len() - 1 - 2 * spacing);
    let three = [0, 1, 2].map(|part| places[first + part * spacing]);
    let (x, _) = places[i];
    // Derivative of Lagrange's polynomials.
    let part = |[at, b, c]: [usize; 3]| {
        let ((x_at, place), x_b, x_c) = (three[at], three[b].0, three[c].0);
        place * ((2.0 * x - x_b - x_c) / ((x_at - x_b) * (x_at - x_c)))
    };
    part([0, 1, 2]) + part([1, 0, 2]) + part([2, 0, 1])
}

/// Smallest and largest displacement of the reference range from the scene's origin, metres.
pub(super) fn reference_displacements_m(collection: &Collection) -> [f64; 2] {
    let displacements = collection
        .pulses
        .iter()
        .map(|pulse| pulse.reference_path_m / 2.0 - pulse.transmitter_m.length());
    displacements.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}
