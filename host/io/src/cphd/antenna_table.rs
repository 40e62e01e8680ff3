//! Main lobe of a gain polynomial as samples over azimuth and elevation.
//!
//! The polynomials of a file hold near the boresight and grow without limit far from it. Samples therefore reach from the electrical boresight, along each axis, to the
//! first angle where the gain is [`DEPTH_DB`] below its value there or stops falling, at most [`FARTHEST_RAD`]. Between the axes a gain is at most that of either cut. The steps
//! are a fortieth of the half-power width: bilinear amplitudes are then off by at most 0.05 % of the maximum.

use subaperture_model::antenna::{Pattern, PatternTable};

/// Depth of the main lobe, dB.
const DEPTH_DB: f64 = 30.0;
/// Farthest angle from the boresight, radians.
const FARTHEST_RAD: f64 = 1.0;
/// Fall of the gain at half the power, dB.
const HALF_POWER_DB: f64 = 3.010_299_956_639_812;
/// Steps in a half-power width.
const STEPS: f64 = 40.0;
/// Maximum number of samples along an axis.
const MOST: usize = 401;
/// First step of the search, radians, and its growth.
const FIRST_RAD: f64 = 1e-6;
const GROWTH: f64 = 1.02;

/// Sample a gain in dB over azimuth and elevation about its electrical boresight, both in radians. Isotropic for a gain that does not fall to half of its power along
/// either axis; `None` for a gain that is not a number there.
pub(super) fn sampled(gain_db: impl Fn(f64, f64) -> f64, boresight: [f64; 2]) -> Option<Pattern> {
    let [azimuth, elevation] = boresight;
    if !gain_db(azimuth, elevation).is_finite() {
        return None;
    }
    let axes = [
        axis(|angle| gain_db(angle, elevation), azimuth),
        axis(|angle| gain_db(azimuth, angle), elevation),
    ];
    let [azimuths, elevations] = match axes {
        [None, None] => return Some(Pattern::Isotropic),
        [azimuths, elevations] => [
            azimuths.unwrap_or_else(|| vec![azimuth]),
            elevations.unwrap_or_else(|| vec![elevation]),
        ],
    };
    let gains = elevations.iter().flat_map(|&el| {
        let cuts = azimuths.iter().map(move |&az| (az, el));
        cuts.map(|(az, el)| {
            let most = gain_db(az, elevation).min(gain_db(azimuth, el));
            gain_db(az, el).min(most)
        })
        .collect::<Vec<_>>()
    });
    let gains: Vec<f64> = gains.collect();
    let table = PatternTable::new(azimuths, elevations, &gains);
    Some(Pattern::Table(table.ok()?))
}

/// Angles of the samples along an axis; `None` if the gain does not fall to half of its power to both sides.
fn axis(gain_db: impl Fn(f64) -> f64, boresight: f64) -> Option<Vec<f64>> {
    let top_db = gain_db(boresight);
    let side = |sign: f64| {
        let (mut lowest_db, mut reached, mut half) = (top_db, 0.0, None);
        let mut step = FIRST_RAD;
        while step < FARTHEST_RAD {
            let db = gain_db(boresight + sign * step);
            // A lobe whose top is beside the boresight rises before it falls.
            if db.is_nan() || (db > lowest_db && half.is_some()) {
                break;
            }
            (lowest_db, reached) = (db, step);
            if half.is_none() && db <= top_db - HALF_POWER_DB {
                half = Some(step);
            }
            if db < top_db - DEPTH_DB {
                break;
            }
            step *= GROWTH;
        }
        Some((half?, reached))
    };
    let [(back, first), (forward, last)] = [side(-1.0)?, side(1.0)?];
    let steps = ((first + last) / (back + forward) * STEPS).ceil();
    let count = (steps as usize).clamp(2, MOST - 1);
    let at = |i: usize| boresight - first + (first + last) * i as f64 / count as f64;
    Some((0..=count).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_follow_a_lobe_and_stop_where_its_polynomial_grows() {
        // Half the power at 0.05 rad in azimuth about 0.02; a fourth-order term makes the gain grow beyond 0.135 rad.
        let gain_db = |az: f64, el: f64| {
            let x = (az - 0.02) / 0.05;
            7.0 - HALF_POWER_DB * (x * x - x.powi(4) / 14.6 + (el / 0.3).powi(2))
        };
        let Some(Pattern::Table(table)) = sampled(gain_db, [0.02, 0.0]) else {
            panic!("expected a table");
        };
        for (az, el) in [(0.02, 0.0), (0.06, 0.1), (-0.05, -0.3), (0.1, 0.4)] {
            let expected = 10f64.powf((gain_db(az, el) - 7.0) / 20.0);
            let amplitude = table.amplitude(az, el);
            // f'' h^2 / 8 in both axes with h a fortieth of the width, f'' = 4 ln 2 / w^2.
            assert!(
                (amplitude - expected).abs() < 5e-4,
                "{az} {el}: {amplitude} {expected}"
            );
        }
        assert_eq!(table.amplitude(0.2, 0.0), 0.0);
        let last = *table.azimuth_rad().last().unwrap();
        assert!((0.14..0.17).contains(&last), "{last}");
        assert_eq!(sampled(|_, _| 3.0, [0.0; 2]), Some(Pattern::Isotropic));
        assert_eq!(sampled(|_, _| f64::NAN, [0.0; 2]), None);
    }
}
