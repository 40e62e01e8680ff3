//! Measured tracks: positions in the scene's axes or in ECEF, with or without velocities.
//!
//! ECEF is Earth-centred, Earth-fixed (WGS 84). Such positions are converted to the scene's axes, x east, y north and z up at the origin.
//!
//! | state vectors | curve between them |
//! |---|---|
//! | with velocities, in either frame | [`StateVectors`], Hermite polynomial of degree 7 |
//! | orbit (ECEF, [`ORBIT_M`]) without velocities, sparse | [`StateVectors`], Lagrange polynomial of degree 7 |
//! | others, and dense ones of an orbit | [`SampledTrack`], cubic spline |
//!
//! An orbit's positions are dense if the spline is accurate to a hundredth of the wavelength at its ends, where its acceleration is zero and
//! the orbit's is `a = r w^2`: the error there is at most `a h^2 / 4` for intervals `h`. The polynomials' error is bounded for every pulse.

use std::sync::Arc;

use glam::DVec3;

use super::keys::{PlatformKeys, RadarKeys, TrackFrame, WaveformKeys};
use crate::track_axes::TrackAxes;
use subaperture_describe::error::Fault;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{
    Fix, Pose, SampledTrack, StateVectors, TrackError, Trajectory, orbit_rate_rad_s,
};

/// Distances from the Earth's centre of positions in ECEF, metres: from the ground to beyond geosynchronous orbits.
pub(super) const FROM_CENTRE_M: [f64; 2] = [6.3e6, 5e7];

/// Least distance of an orbit from the Earth's centre, metres.
const ORBIT_M: f64 = 6.5e6;

/// Largest interpolation error of an orbit, wavelengths.
const PART: f64 = 0.01;

/// Fixes as read, in metres and metres per second.
pub(super) struct Measured {
    pub(super) fixes: Vec<Fix>,
    pub(super) velocities_m_s: Option<Vec<DVec3>>,
}

/// State vectors whose interpolation error is bounded.
#[derive(Clone)]
pub(super) struct Bounded {
    vectors: Arc<StateVectors>,
    centre_m: DVec3,
    most_m: f64,
}

impl Bounded {
    /// The interpolation error at a time, if it exceeds a hundredth of the wavelength.
    pub(super) fn fault(&self, time_s: f64) -> Option<String> {
        let error_m = self.vectors.orbit_error_m(time_s, self.centre_m);
        (error_m > self.most_m).then(|| {
            format!(
                "the state vectors give the position at {time_s:.3} s to {error_m:.1e} m, expected a hundredth of the wavelength, {:.1e} m: give state vectors closer in time, \
                 with velocities, and on both sides of the pulses",
                self.most_m
            )
        })
    }
}

/// Curve through measured positions, and where it is known.
pub(super) struct Curve {
    pub(super) body: Arc<dyn Trajectory>,
    pub(super) span_s: Option<(f64, f64)>,
    pub(super) bounded: Option<Bounded>,
}

/// Positions by state vectors and attitudes of fixes.
#[derive(Debug)]
struct Turning {
    places: Arc<StateVectors>,
    attitudes: SampledTrack,
}

impl Trajectory for Turning {
    fn pose(&self, time_s: f64) -> Pose {
        let [position_m, _] = self.places.at(time_s);
        Pose {
            position_m,
            ..self.attitudes.pose(time_s)
        }
    }
}

/// Curve of a platform through measured positions in the frame that it states, and with these axes in the scene's. `fault` makes a fault at the
/// key of the positions.
pub(super) fn curve(
    platform: &PlatformKeys,
    radar: &RadarKeys,
    (frame, axes): (&SceneFrame, TrackAxes),
    measured: Measured,
    fault: &dyn Fn(String) -> Fault,
) -> Result<Curve, Fault> {
    let earth_fixed = is_earth_fixed(platform, &measured.fixes, fault)?;
    let measured = match earth_fixed {
        true => in_scene(platform, frame, measured, fault)?,
        false => turned(axes, measured),
    };
    let Measured {
        fixes,
        velocities_m_s,
    } = measured;
    let known = velocities_m_s.is_some();
    let centre_m = frame.from_ecf_m(DVec3::ZERO);
    let nearest_m = (fixes.iter())
        .map(|fix| fix.position_m.distance(centre_m))
        .fold(f64::INFINITY, f64::min);
    let orbit = earth_fixed && nearest_m >= ORBIT_M;
    let most_m = PART * wavelength_m(radar);
    let track_fault = |error: TrackError| fault(error.to_string());
    let polynomial = known || (orbit && is_sparse(&fixes, nearest_m, most_m));
    if !polynomial {
        let ends = fixes.first().zip(fixes.last());
        return Ok(Curve {
            body: Arc::new(SampledTrack::new(&fixes).map_err(track_fault)?),
            span_s: ends.map(|(first, last)| (first.time_s, last.time_s)),
            bounded: None,
        });
    }
    let times_s = fixes.iter().map(|fix| fix.time_s).collect();
    let positions_m = fixes.iter().map(|fix| fix.position_m).collect();
    let vectors = StateVectors::new(times_s, positions_m, velocities_m_s);
    let vectors = Arc::new(vectors.map_err(track_fault)?);
    vectors.check_velocities().map_err(track_fault)?;
    let [from_s, to_s] = vectors.known_s();
    let body: Arc<dyn Trajectory> = match fixes.iter().any(|fix| fix.attitude.is_some()) {
        true => Arc::new(Turning {
            places: Arc::clone(&vectors),
            attitudes: SampledTrack::new(&fixes).map_err(track_fault)?,
        }),
        false => vectors.clone(),
    };
    Ok(Curve {
        body,
        span_s: Some((from_s, to_s)),
        bounded: orbit.then_some(Bounded {
            vectors,
            centre_m,
            most_m,
        }),
    })
}

/// Whether positions are in ECEF as stated. Positions that can only be in ECEF without a statement are refused.
fn is_earth_fixed(
    platform: &PlatformKeys,
    fixes: &[Fix],
    fault: &dyn Fn(String) -> Fault,
) -> Result<bool, Fault> {
    let around =
        |fix: &Fix| (FROM_CENTRE_M[0]..=FROM_CENTRE_M[1]).contains(&fix.position_m.length());
    let Some(stated) = &platform.frame else {
        return match fixes.is_empty() || !fixes.iter().all(around) {
            true => Ok(false),
            false => Err(fault(format!(
                "positions look like ECEF: the first is {:.0} km from the origin; state frame = \"ecef\" in [platform], or frame = \"scene\" if these are the scene's axes",
                fixes[0].position_m.length() / 1e3
            ))),
        };
    };
    match (**stated, fixes.iter().find(|fix| !around(fix))) {
        (TrackFrame::Scene, _) => Ok(false),
        (TrackFrame::Ecef, None) => Ok(true),
        (TrackFrame::Ecef, Some(fix)) => Err(fault(format!(
            "expected positions in ECEF, {:.0} to {:.0} km from the Earth's centre, found {:.3} km at {} s: check frame and the unit of positions",
            FROM_CENTRE_M[0] / 1e3,
            FROM_CENTRE_M[1] / 1e3,
            fix.position_m.length() / 1e3,
            fix.time_s
        ))),
    }
}

/// Conversion from ECEF to the scene's axes.
fn in_scene(
    platform: &PlatformKeys,
    frame: &SceneFrame,
    measured: Measured,
    fault: &dyn Fn(String) -> Fault,
) -> Result<Measured, Fault> {
    let stated = platform.frame.as_ref();
    let refused = |why: &str| match stated {
        Some(key) => key.fault(why),
        None => fault(why.to_owned()),
    };
    if *frame == SceneFrame::Local {
        return Err(refused(
            "positions in ECEF need the scene's origin on the Earth: add [scene.origin] with latitude, longitude and height",
        ));
    }
    if let Some(axes) = &platform.axes {
        return Err(
            axes.fault("'axes' reorders the scene's axes, and positions are in ECEF: remove it")
        );
    }
    if measured.fixes.iter().any(|fix| fix.attitude.is_some()) {
        return Err(fault(
            "roll, pitch and yaw are those of the scene's axes, and positions are in ECEF: remove these columns, or state a constant attitude in [platform]"
                .to_owned(),
        ));
    }
    let moved = |fix: Fix| Fix {
        position_m: frame.from_ecf_m(fix.position_m),
        ..fix
    };
    let velocities = measured.velocities_m_s.map(|velocities| {
        let turned = velocities.into_iter().map(|v| frame.direction_from_ecf(v));
        turned.collect()
    });
    Ok(Measured {
        fixes: measured.fixes.into_iter().map(moved).collect(),
        velocities_m_s: velocities,
    })
}

/// Conversion from the axes of the file to those of the scene.
fn turned(axes: TrackAxes, measured: Measured) -> Measured {
    let turned = |fix: Fix| Fix {
        position_m: axes.turn(fix.position_m),
        attitude: fix.attitude.map(|attitude| axes.turn_attitude(attitude)),
        ..fix
    };
    let velocities = measured.velocities_m_s;
    Measured {
        fixes: measured.fixes.into_iter().map(turned).collect(),
        velocities_m_s: velocities
            .map(|velocities| velocities.into_iter().map(|v| axes.turn(v)).collect()),
    }
}

/// Whether a cubic spline through the positions of an orbit may be wrong by more than `most_m` at its ends.
fn is_sparse(fixes: &[Fix], radius_m: f64, most_m: f64) -> bool {
    let longest_s = (fixes.windows(2))
        .map(|pair| pair[1].time_s - pair[0].time_s)
        .fold(0.0, f64::max);
    let acceleration_m_s2 = radius_m * orbit_rate_rad_s(radius_m).powi(2);
    0.25 * acceleration_m_s2 * longest_s * longest_s > most_m
}

/// Wavelength of the radar, metres: of the centre or an end of its band; infinite if not stated, which is a fault elsewhere except for Touchstone files.
fn wavelength_m(radar: &RadarKeys) -> f64 {
    let frequency_hz = match &*radar.kind {
        WaveformKeys::Fmcw(_) | WaveformKeys::Stepped => {
            radar.start_hz.as_deref().copied().unwrap_or(0.0)
        }
        WaveformKeys::Profiles(keys) => keys.band_hz.1,
        WaveformKeys::Pulsed(_) => radar.centre_hz.as_deref().copied().unwrap_or(0.0),
    };
    SPEED_OF_LIGHT_M_S / frequency_hz
}
