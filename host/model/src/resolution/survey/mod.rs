//! Survey of a collection: band, resolution, unambiguous extent, aperture, geometry and
//! default grid.
//!
//! Resolution and pixel spacing follow from the spectral support
//! ([`crate::resolution::support`]) at a scene point, projected on a direction: its true shape
//! and weights, not its bounding box. For a broadside monostatic pass, resolutions are the textbook's `c / (2 B cos g)`
//! and `lambda R / (2 L)` at grazing angle `g` and aperture length `L`, and the unambiguous extents, one
//! over the sample spacing, are `c / (2 step cos g)` and `lambda R / (2 d)` at pulse spacing `d`
//! (Carrara, Goodman and Majewski, chapter 2).
//!
//! *Resolution* is Rayleigh's, without a window; *half-power width* is the 3 dB width of the response, 0.886 of it
//! without windows. The antenna beam is unknown to a collection and neglected; it reduces the resolution.
//!
//! Neglected: the Earth's curvature in angles.

mod aperture;
mod coarse;
pub mod default_grid;
mod geometry;
use geometry::{angle_between, median, positive};

use glam::DVec3;
use serde::Serialize;

use crate::SPEED_OF_LIGHT_M_S;
use crate::geometry::{Extent, Geodetic, SceneFrame};
use crate::phase_history::{Collection, Pulse};
use crate::resolution::support::{Looks, Projection, Support, path_gradient};
use aperture::Aperture;
use subaperture_signal::window::Window;

pub use coarse::CoarseAxis;
pub use default_grid::{DefaultGrid, MAX_PIXELS, NoDefaultGrid, scene_grid};

/// Samples per side of the scene at which the support is evaluated for the pixel spacing.
const PROBES: usize = 9;

/// Look side of the antenna.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Scene to the left of the velocity, seen from above.
    Left,
    /// Scene to the right of the velocity, seen from above.
    Right,
}

/// Survey of a collection before image formation: band, aperture, geometry, and the
/// resulting resolution, ambiguities and pixel spacing. `None` means that the geometry has no such value (a static antenna
/// has no cross-range resolution) or that it is not recorded.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Survey {
    /// Name of the collection.
    pub name: String,
    /// Number of pulses.
    pub num_pulses: usize,
    /// Frequency samples per pulse.
    pub num_samples: usize,
    /// Lowest frequency of any pulse, hertz.
    pub lowest_hz: f64,
    /// Highest frequency of any pulse, hertz.
    pub highest_hz: f64,
    /// Bandwidth of the first pulse, `num_samples * step_hz`, hertz.
    pub bandwidth_hz: f64,
    /// Frequency step of the first pulse, hertz.
    pub step_hz: f64,
    /// Whether all pulses have the same frequencies.
    pub band_is_shared: bool,
    /// Wavelength at the band centre, metres.
    pub wavelength_m: f64,

    /// Slant range resolution at the middle pulse, `c / (2 bandwidth)`, larger for a bistatic pair, metres.
    pub slant_range_resolution_m: f64,
    /// Resolution in the scene plane along the line of sight, metres.
    pub range_resolution_m: Option<f64>,
    /// Resolution in the scene plane across the line of sight, metres.
    pub cross_range_resolution_m: Option<f64>,
    /// 3 dB widths of the response, without windows.
    pub half_power: Widths,
    /// 3 dB widths with the default window over fast and slow time.
    pub half_power_windowed: Widths,
    /// Unambiguous slant range, `c / (2 step)`, metres.
    pub unambiguous_slant_range_m: f64,
    /// Whether the scene centre is at the antennas (closer to one than a quarter of the aperture's chord): the scene position
    /// is not recorded, or the scene surrounds the radar. Resolution and geometry are then meaningless.
    pub centre_at_antennas: bool,
    /// Unambiguous extent in the scene plane along the line of sight, metres.
    pub unambiguous_range_m: Option<f64>,
    /// Unambiguous extent in the scene plane across the line of sight, metres.
    pub unambiguous_cross_range_m: Option<f64>,
    /// Extent in the scene plane along the line of sight, centred on the scene centre, that the samples of every pulse contain, metres; `None` if the
    /// recording does not state its receive window.
    pub recorded_range_m: Option<f64>,

    /// Time from the first to the last pulse, seconds.
    pub duration_s: Option<f64>,
    /// Median pulse interval, seconds.
    pub pri_s: Option<f64>,
    /// Median pulse spacing of the antenna (of the bistatic
    /// midpoint), metres.
    pub pulse_spacing_m: Option<f64>,
    /// Length of the aperture from end to end, or along the track around the scene, metres.
    pub aperture_length_m: f64,
    /// Largest angle between two antenna positions seen from the scene centre, degrees.
    pub aperture_angle_deg: f64,
    /// Azimuth span of the aperture, degrees; 360 for a full circle.
    pub aperture_azimuth_deg: f64,

    /// Reference point of geometry and resolution, metres: centre of the declared extent, else the origin, or as given.
    pub scene_centre_m: [f64; 3],
    /// Slant range: half the path from transmitter via scene centre to receiver at the middle pulse, metres.
    pub slant_range_m: f64,
    /// Grazing angle at the scene centre, degrees.
    pub grazing_angle_deg: f64,
    /// Azimuth of the antenna from the scene centre, degrees from x towards y.
    pub azimuth_deg: f64,
    /// Squint angle off broadside, forward positive, degrees.
    pub squint_deg: Option<f64>,
    /// Look side.
    pub side: Option<Side>,
    /// Bistatic angle at the scene centre, degrees.
    pub bistatic_angle_deg: f64,

    /// Position of the scene origin on the Earth.
    pub origin: Option<Geodetic>,
    /// Declared extent: smallest and largest x, then y, metres.
    pub declared_extent_m: Option<[(f64, f64); 2]>,
    /// Resolution along the frame's x and y axes, metres.
    pub axis_resolution_m: [Option<f64>; 2],
    /// Largest alias-free pixel spacing along x and y anywhere in the extent of the default grid, metres:
    /// one over the widest extent of the support.
    pub nyquist_step_m: [Option<f64>; 2],
}

/// 3 dB widths of the response, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Widths {
    /// Along the middle pulse's line of sight, metres.
    pub slant_range_m: Option<f64>,
    /// In the scene plane along the line of sight, metres.
    pub range_m: Option<f64>,
    /// In the scene plane across the line of sight, metres.
    pub cross_range_m: Option<f64>,
}

/// Projections of the support on the middle pulse's line of sight, on range and on cross-range.
type Views = [Option<Projection>; 3];

fn views(support: &Support, (line_of_sight, range, cross): (Option<DVec3>, DVec3, DVec3)) -> Views {
    let along = |direction| support.along(direction);
    [line_of_sight.and_then(along), along(range), along(cross)]
}

impl Widths {
    /// Widths along each of these.
    fn of(views: &Views, slant_range_m: f64) -> Self {
        let [slant_range_m, range_m, cross_range_m] = views.each_ref().map(|view| {
            let width_m = view.as_ref()?.width_3db_m();
            resolved(width_m, slant_range_m)
        });
        Self {
            slant_range_m,
            range_m,
            cross_range_m,
        }
    }
}

/// `None` for a width above the slant range, which is no resolution.
fn resolved(width_m: Option<f64>, slant_range_m: f64) -> Option<f64> {
    width_m.filter(|&m| m < slant_range_m)
}

/// Lowest and highest frequency of any pulse.
fn ends_of_band_hz(collection: &Collection) -> (f64, f64) {
    let pulses = collection.pulses.iter();
    let lowest_hz = pulses
        .clone()
        .map(|p| p.start_hz)
        .fold(f64::INFINITY, f64::min);
    let top = collection.num_samples.saturating_sub(1);
    let highest_hz = pulses.map(|p| p.frequency_hz(top)).fold(0.0, f64::max);
    (lowest_hz, highest_hz)
}

/// Median pulse spacing, metres.
fn pulse_spacing_m(pulses: &[Pulse]) -> Option<f64> {
    median(
        pulses
            .windows(2)
            .map(|w| w[0].phase_centre_m().distance(w[1].phase_centre_m())),
    )
}

impl Survey {
    /// Survey at the scene centre; `None` without pulses.
    pub fn of(collection: &Collection) -> Option<Self> {
        Self::at(collection, scene_centre(collection))
    }

    /// Survey at the point `centre`, metres in the scene frame; `None` without pulses.
    pub fn at(collection: &Collection, centre: DVec3) -> Option<Self> {
        let pulses = &collection.pulses;
        let first = pulses.first()?;
        let middle = &pulses[pulses.len() / 2];
        let num_samples = collection.num_samples;
        let looks = Looks::new(collection, Window::None, Window::None);
        let support = looks.at(centre);

        let (lowest_hz, highest_hz) = ends_of_band_hz(collection);
        let bandwidth_hz = num_samples as f64 * first.step_hz;

        let slant_range_m = middle.path_m(centre) / 2.0;
        let line_of_sight = (centre - middle.phase_centre_m()).normalize_or_zero();
        // Path gradient along the bisector, 2 for a monostatic radar.
        let gradient = path_gradient(middle.transmitter_m, middle.receiver_m, centre);
        let [range, cross] = support.range_and_cross([DVec3::X, DVec3::Y]);
        let resolved = |width_m| resolved(width_m, slant_range_m);
        let resolution = |view: &Option<Projection>| resolved(view.as_ref()?.resolution_m());
        let directions = (gradient.try_normalize(), range, cross);
        let plain = views(&support, directions);
        let windowed = Looks::new(collection, Window::default(), Window::default());
        let windowed = views(&windowed.at(centre), directions);
        let [_, in_range, across] = &plain;
        let aperture = Aperture::of(pulses, centre);
        let velocity = velocity_direction(pulses);
        let to_antenna = -line_of_sight;
        let timed = |seconds: Option<f64>| seconds.filter(|_| collection.timed);
        let seen = |antenna: DVec3| (antenna - centre).normalize_or_zero();
        let mut survey = Self {
            name: collection.name.clone(),
            num_pulses: pulses.len(),
            num_samples,
            lowest_hz,
            highest_hz,
            bandwidth_hz,
            step_hz: first.step_hz,
            band_is_shared: collection.band().is_some(),
            wavelength_m: SPEED_OF_LIGHT_M_S / (lowest_hz.midpoint(highest_hz)),
            slant_range_resolution_m: SPEED_OF_LIGHT_M_S
                / (bandwidth_hz * positive(gradient.length()).unwrap_or(2.0)),
            range_resolution_m: resolution(in_range),
            cross_range_resolution_m: resolution(across),
            half_power: Widths::of(&plain, slant_range_m),
            half_power_windowed: Widths::of(&windowed, slant_range_m),
            unambiguous_slant_range_m: SPEED_OF_LIGHT_M_S / (2.0 * first.step_hz),
            centre_at_antennas: is_at_antennas(pulses, centre, aperture.chord_m),
            unambiguous_range_m: aperture::unambiguous_range_m(middle, centre),
            unambiguous_cross_range_m: aperture::unambiguous_cross_m(
                collection,
                centre,
                slant_range_m,
            ),
            recorded_range_m: aperture::recorded_range_m(pulses, middle, centre),
            duration_s: timed(positive(pulses[pulses.len() - 1].time_s - first.time_s)),
            pri_s: timed(median(pulses.windows(2).map(|w| w[1].time_s - w[0].time_s))),
            pulse_spacing_m: pulse_spacing_m(pulses),
            aperture_length_m: aperture.length_m,
            aperture_angle_deg: aperture.angle_rad.to_degrees(),
            aperture_azimuth_deg: aperture.azimuth_rad.to_degrees(),
            scene_centre_m: centre.to_array(),
            slant_range_m,
            grazing_angle_deg: libm::asin(to_antenna.z.clamp(-1.0, 1.0)).to_degrees(),
            azimuth_deg: libm::atan2(to_antenna.y, to_antenna.x).to_degrees(),
            squint_deg: velocity
                .map(|v| libm::asin(v.dot(line_of_sight).clamp(-1.0, 1.0)).to_degrees()),
            side: velocity.and_then(|v| side(v, line_of_sight)),
            bistatic_angle_deg: angle_between(seen(middle.transmitter_m), seen(middle.receiver_m))
                .to_degrees(),
            origin: geodetic_origin(&collection.frame),
            declared_extent_m: collection.extent.map(|e| [e.x_m, e.y_m]),
            axis_resolution_m: [DVec3::X, DVec3::Y].map(|axis| resolution(&support.along(axis))),
            nyquist_step_m: [None; 2],
        };
        if let Ok(extent) = survey.extent() {
            survey.nyquist_step_m = nyquist_step_m(&looks, &extent, slant_range_m);
        }
        Some(survey)
    }

    /// Cross-range distance to the first grating lobe for sub-CPIs of
    /// `num_pulses` pulses with plain interpolation (the thesis's mode), metres: `lambda R / (2 D)`
    /// with the sub-CPI spacing `D`, as for an array with element spacing `2 D`
    /// (Schone 2020, S 4.1.2).
    pub fn grating_lobe_m(&self, num_pulses: usize) -> Option<f64> {
        self.unambiguous_cross_range_m
            .map(|extent_m| extent_m / num_pulses.max(1) as f64)
    }
}

/// Centre of the declared extent, or else the mean of the phase reference points; on the plane of the default grid.
fn scene_centre(collection: &Collection) -> DVec3 {
    if let Some(extent) = collection.extent {
        let middle = |(low, high): (f64, f64)| low.midpoint(high);
        return DVec3::new(middle(extent.x_m), middle(extent.y_m), 0.0);
    }
    let pulses = &collection.pulses;
    let Some(first) = pulses.first() else {
        return DVec3::ZERO;
    };
    // Mean of differences, which is exact where all pulses share one point.
    let apart = pulses
        .iter()
        .map(|pulse| pulse.reference_m - first.reference_m);
    let mean_m = first.reference_m + apart.sum::<DVec3>() / pulses.len() as f64;
    DVec3::new(mean_m.x, mean_m.y, 0.0)
}

/// Fraction of the aperture's chord within which a point is at the antennas: half the distance of a circle's centre.
const AT_ANTENNAS: f64 = 0.25;

/// Whether a point has no meaningful line of sight: closer to an antenna than a quarter of the aperture's chord.
fn is_at_antennas(pulses: &[Pulse], centre_m: DVec3, chord_m: f64) -> bool {
    let distances = pulses
        .iter()
        .map(|pulse| pulse.phase_centre_m().distance(centre_m));
    distances.fold(f64::INFINITY, f64::min) < AT_ANTENNAS * chord_m
}

/// Direction of flight around the middle pulse, over a sixteenth of the aperture.
fn velocity_direction(pulses: &[Pulse]) -> Option<DVec3> {
    let middle = pulses.len() / 2;
    let reach = (pulses.len() / 32).max(1);
    let from = pulses[middle.saturating_sub(reach)].phase_centre_m();
    let to = pulses[(middle + reach).min(pulses.len() - 1)].phase_centre_m();
    (to.distance(from) > 1e-9 * from.length().max(1.0)).then(|| (to - from).normalize())
}

fn side(velocity: DVec3, line_of_sight: DVec3) -> Option<Side> {
    let up = velocity.cross(line_of_sight).z;
    if up.abs() < 1e-6 {
        None
    } else if up > 0.0 {
        Some(Side::Left)
    } else {
        Some(Side::Right)
    }
}

/// One over the widest extent of the support along x and y at `PROBES` x `PROBES` points of `extent`, edges and corners
/// included: off boresight near the antennas the support is wider than at the centre.
fn nyquist_step_m(looks: &Looks, extent: &Extent, limit_m: f64) -> [Option<f64>; 2] {
    let at =
        |(low, high): (f64, f64), i: usize| low + (high - low) * i as f64 / (PROBES - 1) as f64;
    let mut widest = [0.0f64; 2];
    for i in 0..PROBES * PROBES {
        let place_m = DVec3::new(at(extent.x_m, i % PROBES), at(extent.y_m, i / PROBES), 0.0);
        let support = looks.at(place_m);
        for (widest, axis) in widest.iter_mut().zip([DVec3::X, DVec3::Y]) {
            if let Some([low, high]) = support.extent(axis) {
                *widest = widest.max(high - low);
            }
        }
    }
    widest.map(|extent| positive(1.0 / extent).filter(|&step_m| step_m < limit_m))
}

/// Geodetic position of a frame's origin.
fn geodetic_origin(frame: &SceneFrame) -> Option<Geodetic> {
    match frame {
        SceneFrame::Earth { origin_ecf_m, .. } => Some(Geodetic::from_ecf_m(*origin_ecf_m)),
        SceneFrame::Local => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::phase_history::Sweep;

    /// Monostatic pass along x at height and ground distance `range_m / sqrt(2)`.
    fn pass(spacing_m: f64, num_pulses: usize) -> Collection {
        let pulses = (0..num_pulses)
            .map(|n| {
                let x = (n as f64 - (num_pulses as f64 - 1.0) / 2.0) * spacing_m;
                let antenna_m = DVec3::new(x, -5000.0, 5000.0);
                Pulse {
                    time_s: n as f64 * 1e-3,
                    transmitter_m: antenna_m,
                    receiver_m: antenna_m,
                    reference_m: DVec3::ZERO,
                    reference_path_m: 2.0 * antenna_m.length(),
                    start_hz: 9.9e9,
                    step_hz: 1e6,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
                }
            })
            .collect();
        Collection {
            name: "pass".to_owned(),
            num_samples: 200,
            pulses,
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    fn close(value: Option<f64>, expected: f64, relative: f64) {
        let value = value.expect("a number");
        assert!(
            (value / expected - 1.0).abs() < relative,
            "{value} is not {expected}"
        );
    }

    #[test]
    fn broadside_pass_agrees_with_textbook_formulas() {
        let survey = Survey::of(&pass(0.1, 1001)).unwrap();
        let (range_m, cos) = (5000.0 * 2f64.sqrt(), 0.5f64.sqrt());
        let wavelength_m = SPEED_OF_LIGHT_M_S / 9.9995e9;
        // Neglected: the square of the aperture angle of 0.8 degrees in range; half a sample of the band (0.25 %).
        close(
            survey.range_resolution_m,
            SPEED_OF_LIGHT_M_S / (2.0 * 200e6 * cos),
            2e-3,
        );
        close(
            survey.cross_range_resolution_m,
            wavelength_m * range_m / (2.0 * 100.1),
            2e-3,
        );
        close(
            survey.half_power.cross_range_m,
            0.885_893 * wavelength_m * range_m / (2.0 * 100.1),
            2e-3,
        );
        // Taylor weighting of 35 dB broadens by 1.185 / 0.886 (`quality::theory`).
        close(
            survey.half_power_windowed.cross_range_m,
            1.185 * wavelength_m * range_m / (2.0 * 100.1),
            5e-3,
        );
        close(
            survey.unambiguous_range_m,
            SPEED_OF_LIGHT_M_S / (2.0 * 1e6 * cos),
            1e-3,
        );
        close(
            survey.unambiguous_cross_range_m,
            wavelength_m * range_m / (2.0 * 0.1),
            1e-3,
        );
        close(
            survey.grating_lobe_m(50),
            wavelength_m * range_m / (2.0 * 5.0),
            1e-3,
        );
        close(Some(survey.aperture_length_m), 100.0, 1e-9);
        close(Some(survey.grazing_angle_deg), 45.0, 1e-6);
        close(survey.pri_s, 1e-3, 1e-9);
        assert!(survey.squint_deg.unwrap().abs() < 0.01);
        // Flight along +x, look along +y: left.
        assert_eq!(survey.side, Some(Side::Left));
        assert_eq!(survey.bistatic_angle_deg, 0.0);
    }

    /// A window of slant ranges from 40 m before to 60 m after the centre of the middle pulse, which is the nearest one. At a grazing angle of
    /// 45 degrees, 2 x 40 m of slant range are 113 m of ground range.
    #[test]
    fn default_grid_is_limited_to_recorded_delays() {
        let mut collection = pass(0.1, 1001);
        let centre_path_m = collection.pulses[500].path_m(DVec3::ZERO);
        for pulse in &mut collection.pulses {
            pulse.recorded_path_m = Some([centre_path_m - 80.0, centre_path_m + 120.0]);
        }
        let survey = Survey::of(&collection).unwrap();
        let expected_m = 80.0 * 2f64.sqrt();
        close(survey.recorded_range_m, expected_m, 1e-3);
        let grid = survey.default_grid().unwrap().grid;
        let deep_m = grid.rows.step * grid.rows.count as f64;
        assert!((deep_m / expected_m - 1.0).abs() < 0.02, "{deep_m}");
        for row in [0, grid.rows.count - 1] {
            let point_m = grid.position_m(row, grid.columns.count / 2);
            for pulse in &collection.pulses {
                let [low_m, high_m] = pulse.recorded_path_m.unwrap();
                assert!(
                    (low_m..=high_m).contains(&pulse.path_m(point_m)),
                    "{point_m}"
                );
            }
        }
        // A window that does not contain the centre gives no limit.
        for pulse in &mut collection.pulses {
            pulse.recorded_path_m = Some([centre_path_m + 80.0, centre_path_m + 120.0]);
        }
        assert_eq!(Survey::of(&collection).unwrap().recorded_range_m, None);
    }

    #[test]
    fn default_grid_covers_unambiguous_extent_at_half_resolution() {
        let survey = Survey::of(&pass(0.1, 1001)).unwrap();
        let DefaultGrid { grid, cropped } = survey.default_grid().unwrap();
        assert_eq!(cropped, None);
        // Resolution 1.06 m by 1.06 m at the centre; in the corners, up to 6 degrees off broadside, range adds
        // sin(6 degrees) of its band to x: spacing of 0.53 / 1.105 = 0.479 m to 0.53 m, rounded down to two digits.
        for step in [grid.rows.step, grid.columns.step] {
            assert!((0.47..0.53).contains(&step), "{step}");
        }
        let width = grid.columns.step * grid.columns.count as f64;
        assert!((width / survey.unambiguous_cross_range_m.unwrap() - 1.0).abs() < 0.02);
    }

    #[test]
    fn static_antenna_has_no_cross_range_resolution() {
        let survey = Survey::of(&pass(0.0, 64)).unwrap();
        assert_eq!(survey.cross_range_resolution_m, None);
        assert_eq!(survey.unambiguous_cross_range_m, None);
        assert_eq!(survey.pulse_spacing_m, None);
        assert_eq!(survey.squint_deg, None);
        assert_eq!(survey.side, None);
        let error = survey.default_grid().unwrap_err().to_string();
        assert!(error.contains("does not move"), "{error}");
        let json = serde_json::to_string(&survey).unwrap();
        assert!(!json.contains("NaN") && !json.contains("inf"), "{json}");
    }

    #[test]
    fn survey_of_one_pulse_and_of_no_pulses() {
        assert_eq!(Survey::of(&pass(0.1, 0)), None);
        let survey = Survey::of(&pass(0.1, 1)).unwrap();
        assert_eq!(survey.unambiguous_cross_range_m, None);
        assert!(survey.default_grid().is_err());
    }

    #[test]
    fn survey_reports_geodetic_origin() {
        let mut collection = pass(0.1, 4);
        collection.frame = SceneFrame::Earth {
            origin_ecf_m: DVec3::new(6_378_137.0 + 100.0, 0.0, 0.0),
            x_axis_ecf: DVec3::Y,
            y_axis_ecf: DVec3::Z,
        };
        let origin = Survey::of(&collection).unwrap().origin.unwrap();
        assert!(origin.latitude_deg.abs() < 1e-9 && origin.longitude_deg.abs() < 1e-9);
        assert!((origin.height_m - 100.0).abs() < 1e-3);
    }
}
