//! Antenna patterns of a channel as gain polynomials, and the beam that they give.
//!
//! A channel names the pattern and the phase centre of its transmitting and of its receiving antenna
//! (`Channel/Parameters/Antenna`), a phase centre its coordinate frame (`AntCoordFrame`). At time `t` the frame has the axes
//! `X(t)` and `Y(t)`, polynomials in ECF. With `d` a unit vector from the antenna, `DCX = d.X`, `DCY = d.Y` and the electrical
//! boresight `EB(t)` in direction cosines, the one-way gain is, in dB,
//!
//! ```text
//! G(d) = Array(m_x (DCX - s_x EBX), m_y (DCY - s_y EBY)) + Element(DCX, DCY)
//! s = 1 + EBFreqShiftSF (FreqZero / f - 1),    m = 1 + MLFreqDilationSF (f / FreqZero - 1)
//! ```
//!
//! at the centre frequency `f` of the channel. Both scale factors are 0 where `EBFreqShift` or `MLFreqDilation` is false, and 1 where it is true without factors (CPHD 1.0).
//!
//! The beam ([`Beam::of_lobes`]) takes of each antenna the half-power width and the centre of the main lobe in the cut through the
//! electrical boresight and the heading, at the middle pulse; the squint follows the electrical boresight over the pulses. A gain that falls by less than 3 dB to
//! either side is that of an antenna without a main lobe.
//!
//! Weights of image formation ([`Antennas::mounted`]) take the main lobe at the middle pulse as a table ([`super::antenna_table`]) about axes that follow those of the
//! file; the electrical boresight must be constant in these axes.
//!
//! **Neglected.** Attitudes are those at `TxTime` for both antennas; `GainBSPoly`, phase polynomials and sampled patterns (`AntGPId`, `GainPhaseArray`) are not
//! used. The lobe is that at the centre frequency; `EBFreqShift` moves it by up to `EBX B / 2 f` to either side at the edges of a band `B`.
//!
//! Axes and boresights are those of each vector (`TxACX`, `TxACY`, `TxEB` and the receiver's) where `UseACFPVP` or `UseEBPVP` is true. A file that then lacks
//! them has patterns that are not used, and its warnings say so.

use std::collections::HashMap;

use glam::{DMat3, DQuat, DVec3};

use super::antenna_polynomials::{Line, Surface, line, surface, value, value_of_two};
use super::antenna_table::sampled;
use super::antenna_vectors::AntennaVector;
use crate::container::{Element, MetadataError};
use subaperture_model::antenna::{self as model, MountedAntennas};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{Beam, NoBeam, Pulse, headings};

/// Fall of the one-way gain at the edge of a main lobe, dB: `10 log10(2)`.
const HALF_POWER_DB: f64 = 3.010_299_956_639_812;
/// Smallest step from the boresight in the search for the edge of the main lobe, radians, and its growth.
const FIRST_STEP_RAD: f64 = 1e-6;
const STEP_GROWTH: f64 = 1.05;
/// Bisections of an edge: to 1e-9 of the last step.
const BISECTIONS: usize = 30;

/// The `Antenna` branch. A fault in it is a reason not to use a pattern: samples can be read without.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Antennas {
    /// Frame of each phase centre.
    centres: HashMap<String, Result<String, String>>,
    frames: HashMap<String, Result<Frame, String>>,
    patterns: HashMap<String, Result<Pattern, String>>,
}

/// Coordinate frame of an antenna, by polynomials or by vectors.
#[derive(Clone, Debug, PartialEq)]
enum Frame {
    /// Polynomials of the axes X and Y in ECF, each of x, y, z over time.
    Polynomials([[Line; 3]; 2]),
    /// The axes are given per vector.
    PerVector,
}

/// Electrical boresight of a pattern, by polynomials or by vectors.
#[derive(Clone, Debug, PartialEq)]
enum Boresight {
    /// Direction cosines along X and Y over time.
    Polynomials([Line; 2]),
    /// The boresight is given per vector (`TxEB`, `RcvEB`).
    PerVector,
}

/// Phase centre and pattern of the transmitting and of the receiving antenna of a channel, by identifier.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AntennaIds([[String; 2]; 2]);

impl AntennaIds {
    /// Those of a channel's parameters, if it names any.
    pub(super) fn of(parameters: &Element) -> Option<Self> {
        let antenna = parameters.optional("Antenna")?;
        let names = [["TxAPCId", "TxAPATId"], ["RcvAPCId", "RcvAPATId"]];
        Some(Self(names.map(|pair| {
            pair.map(|name| antenna.optional_text(name).unwrap_or_default())
        })))
    }
}

/// Pattern of one antenna.
#[derive(Clone, Debug, PartialEq)]
struct Pattern {
    boresight: Boresight,
    /// Gain about the electrical boresight, dB: exponents of DCX and DCY, coefficient.
    array: Surface,
    /// Gain over direction cosines, dB.
    element: Surface,
    freq_zero_hz: f64,
    shift: [f64; 2],
    dilation: [f64; 2],
}

/// An antenna: its axes and its pattern.
#[derive(Clone, Copy)]
struct Antenna<'a> {
    frame: &'a Frame,
    pattern: &'a Pattern,
}

impl Antennas {
    /// Parse the branch of a document.
    pub(super) fn of(root: &Element) -> Self {
        let Some(antenna) = root.optional("Antenna") else {
            return Self::default();
        };
        Self {
            centres: by_id(&antenna, "AntPhaseCenter", |centre| {
                Ok(centre.child("ACFId")?.text().into_owned())
            }),
            frames: by_id(&antenna, "AntCoordFrame", Frame::parse),
            patterns: by_id(&antenna, "AntPattern", Pattern::parse),
        }
    }

    /// Transmitting and receiving antenna of a channel.
    ///
    /// # Errors
    /// The first identifier without element, or the fault of its element.
    fn pair(&self, ids: &AntennaIds) -> Result<[Antenna<'_>; 2], String> {
        let [transmitter, receiver] = ids.0.each_ref().map(|[centre, pattern]| {
            let frame = found(&self.centres, "AntPhaseCenter", centre)?;
            Ok::<_, String>(Antenna {
                frame: found(&self.frames, "AntCoordFrame", frame)?,
                pattern: found(&self.patterns, "AntPattern", pattern)?,
            })
        });
        Ok([transmitter?, receiver?])
    }

    /// Whether the beam of a channel needs the axes or boresights of each vector.
    pub(super) fn needs_vectors(&self, ids: &AntennaIds) -> bool {
        self.pair(ids)
            .is_ok_and(|pair| pair.iter().any(Antenna::is_per_vector))
    }

    /// Reason not to use the patterns of a channel of a file whose vectors have antennas, or else the fault `without_vectors`.
    pub(super) fn fault(&self, ids: &AntennaIds, without_vectors: Option<&str>) -> Option<String> {
        match (self.pair(ids), without_vectors) {
            (Err(fault), _) => Some(fault),
            (Ok(_), Some(fault)) if self.needs_vectors(ids) => Some(format!(
                "UseACFPVP or UseEBPVP is true, but the vectors have no antenna axes: {fault}"
            )),
            _ => None,
        }
    }

    /// The beam of a channel along the track of these pulses, `centre_hz` the middle of its band. `vectors` has the antennas of each pulse where
    /// [`Self::needs_vectors`]. `None` without main lobes and for patterns with a [`Self::fault`].
    ///
    /// # Errors
    /// [`NoBeam`].
    pub(super) fn beam(
        &self,
        ids: &AntennaIds,
        frame: &SceneFrame,
        pulses: &[Pulse],
        vectors: Option<&[[AntennaVector; 2]]>,
        centre_hz: f64,
    ) -> Result<Option<Beam>, NoBeam> {
        let Ok(pair) = self.pair(ids) else {
            return Ok(None);
        };
        if vectors.is_none() && self.needs_vectors(ids) {
            return Ok(None);
        }
        let at = |n: usize, i: usize| {
            let vector = vectors.and_then(|vectors| vectors.get(n));
            let vector = vector.map(|vector| &vector[i]);
            pair[i].at(frame, pulses[n].time_s, vector, centre_hz)
        };
        let middles_m: Vec<DVec3> = pulses.iter().map(|pulse| pulse.phase_centre_m()).collect();
        let headings = headings(&middles_m);
        if headings.contains(&DVec3::ZERO) {
            return Err(NoBeam::AtRest);
        }
        let middle = pulses.len() / 2;
        let mut lobes = [None; 2];
        for (i, lobe) in lobes.iter_mut().enumerate() {
            let pointing = at(middle, i).ok_or(NoBeam::NoAttitude)?;
            *lobe = pointing.lobe(headings[middle]);
        }
        let boresights =
            (0..pulses.len()).map(|n| Some([at(n, 0)?.boresight, at(n, 1)?.boresight]));
        let boresights = boresights.collect::<Option<Vec<[DVec3; 2]>>>();
        let boresights = boresights.ok_or(NoBeam::NoAttitude)?;
        let times_s: Vec<f64> = pulses.iter().map(|pulse| pulse.time_s).collect();
        let off_rad = lobes.map(|lobe| lobe.map_or(0.0, |lobe: Lobe| lobe.off_rad));
        let widths_rad = lobes.map(|lobe| lobe.map(|lobe| lobe.width_rad));
        Beam::of_lobes(widths_rad, &times_s, &headings, |n, i| {
            (boresights[n][i], off_rad[i])
        })
    }
}

/// Largest change of the electrical boresight in the axes of an antenna that counts as constant, as a direction cosine.
const SAME_COSINE: f64 = 1e-4;

impl Antennas {
    /// Antennas of a channel with the attitudes of their frames, whose Z axis is the boresight of the description; arguments as of [`Self::beam`]. `None` for isotropic antennas, for
    /// patterns with a [`Self::fault`], and for an electrical boresight that changes in its frame.
    pub(super) fn mounted(
        &self,
        ids: &AntennaIds,
        frame: &SceneFrame,
        pulses: &[Pulse],
        vectors: Option<&[[AntennaVector; 2]]>,
        centre_hz: f64,
    ) -> Option<MountedAntennas> {
        let pair = self.pair(ids).ok()?;
        let at = |n: usize, i: usize| {
            let vector = vectors.and_then(|vectors| vectors.get(n));
            let vector = vector.map(|vector| &vector[i]);
            pair[i].at(frame, pulses[n].time_s, vector, centre_hz)
        };
        let mut attitudes = vec![[DQuat::IDENTITY; 2]; pulses.len()];
        let mut antennas = [None, None];
        for (i, antenna) in antennas.iter_mut().enumerate() {
            let middle = at(pulses.len() / 2, i)?;
            for (n, attitude) in attitudes.iter_mut().enumerate() {
                let own = at(n, i)?;
                let moved = [0, 1].map(|axis| (own.cosines[axis] - middle.cosines[axis]).abs());
                if !moved.iter().all(|change| *change <= SAME_COSINE) {
                    return None;
                }
                let [x, y, z] = own.frame()?;
                attitude[i] = DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize();
            }
            *antenna = Some(model::Antenna {
                name: ["transmitter", "receiver"][i].to_owned(),
                offset_m: DVec3::ZERO,
                boresight: DVec3::Z,
                up: DVec3::Y,
                pattern: middle.pattern()?,
                aim_m: None,
            });
        }
        let [Some(transmitter), Some(receiver)] = antennas else {
            return None;
        };
        let mounted = MountedAntennas {
            antennas: [transmitter, receiver],
            attitudes,
        };
        mounted.is_directive().then_some(mounted)
    }
}

/// Parse each element of a name; results by `Identifier`, the first of each.
fn by_id<T>(
    antenna: &Element,
    name: &'static str,
    parse: impl Fn(&Element) -> Result<T, MetadataError>,
) -> HashMap<String, Result<T, String>> {
    let mut parsed = HashMap::new();
    for element in antenna.children(name) {
        if let Some(id) = element.optional_text("Identifier") {
            let fault = |error: MetadataError| error.to_string();
            parsed
                .entry(id)
                .or_insert_with(|| parse(&element).map_err(fault));
        }
    }
    parsed
}

fn found<'a, T>(
    all: &'a HashMap<String, Result<T, String>>,
    name: &str,
    id: &str,
) -> Result<&'a T, String> {
    let missing = || format!("XML: CPHD/Antenna: no {name} has the Identifier '{id}'");
    all.get(id)
        .ok_or_else(missing)?
        .as_ref()
        .map_err(Clone::clone)
}

impl Frame {
    fn parse(frame: &Element) -> Result<Self, MetadataError> {
        if switch(frame, "UseACFPVP")? {
            return Ok(Self::PerVector);
        }
        let axis = |name| -> Result<[Line; 3], MetadataError> {
            let axis = frame.child(name)?;
            Ok([line(&axis, "X")?, line(&axis, "Y")?, line(&axis, "Z")?])
        };
        Ok(Self::Polynomials([axis("XAxisPoly")?, axis("YAxisPoly")?]))
    }
}

/// Angle of a unit vector forward of the plane normal to a heading.
fn angle_rad(direction: DVec3, heading: DVec3) -> f64 {
    libm::asin(direction.dot(heading).clamp(-1.0, 1.0))
}

impl Pattern {
    fn parse(pattern: &Element) -> Result<Self, MetadataError> {
        let boresight = pattern.child("EB")?;
        let gain = |name| surface(&pattern.child(name)?, "GainPoly");
        let freq_zero = pattern.child("FreqZero")?;
        let freq_zero_hz = freq_zero.number()?;
        if freq_zero_hz <= 0.0 {
            return Err(freq_zero.fault(format!(
                "expected a frequency above 0 Hz, found {freq_zero_hz}"
            )));
        }
        Ok(Self {
            boresight: match switch(&boresight, "UseEBPVP")? {
                true => Boresight::PerVector,
                false => Boresight::Polynomials([
                    line(&boresight, "DCXPoly")?,
                    line(&boresight, "DCYPoly")?,
                ]),
            },
            array: gain("Array")?,
            element: gain("Element")?,
            freq_zero_hz,
            shift: scale_factors(pattern, "EBFreqShift", "EBFreqShiftSF")?,
            dilation: scale_factors(pattern, "MLFreqDilation", "MLFreqDilationSF")?,
        })
    }
}

impl<'a> Antenna<'a> {
    fn is_per_vector(&self) -> bool {
        *self.frame == Frame::PerVector || self.pattern.boresight == Boresight::PerVector
    }

    /// The antenna at a time; `None` where its axes do not span a frame or its boresight is not a direction, and where it is per vector without `vector`.
    fn at(
        self,
        scene: &SceneFrame,
        time_s: f64,
        vector: Option<&AntennaVector>,
        centre_hz: f64,
    ) -> Option<Pointing<'a>> {
        let pattern = self.pattern;
        let axes = match self.frame {
            Frame::Polynomials(axes) => axes
                .each_ref()
                .map(|axis| DVec3::from_array(axis.each_ref().map(|line| value(line, time_s)))),
            Frame::PerVector => vector?.axes,
        };
        let axes = axes.map(|axis| scene.direction_from_ecf(axis).try_normalize());
        let [x, y] = [axes[0]?, axes[1]?];
        let z = x.cross(y).try_normalize()?;
        let ratio = pattern.freq_zero_hz / centre_hz;
        let scale =
            |factors: [f64; 2], ratio: f64| factors.map(|factor| 1.0 + factor * (ratio - 1.0));
        let shift = scale(pattern.shift, ratio);
        let recorded = match &pattern.boresight {
            Boresight::Polynomials(lines) => lines.each_ref().map(|line| value(line, time_s)),
            Boresight::PerVector => vector?.boresight,
        };
        let cosines = [0, 1].map(|i| shift[i] * recorded[i]);
        let ahead = 1.0 - cosines[0] * cosines[0] - cosines[1] * cosines[1];
        let boresight = x * cosines[0] + y * cosines[1] + z * ahead.max(0.0).sqrt();
        let boresight = boresight.try_normalize()?;
        (ahead > 0.0).then(|| Pointing {
            pattern,
            axes: [x, y],
            cosines,
            boresight,
            dilation: scale(pattern.dilation, 1.0 / ratio),
        })
    }
}

/// A main lobe in the cut along the track.
#[derive(Clone, Copy, Debug)]
struct Lobe {
    /// Width between its half-power points, radians.
    width_rad: f64,
    /// Angle of its centre forward of the electrical boresight, radians.
    off_rad: f64,
}

/// An antenna at one time and one frequency, in scene axes.
struct Pointing<'a> {
    pattern: &'a Pattern,
    axes: [DVec3; 2],
    cosines: [f64; 2],
    boresight: DVec3,
    dilation: [f64; 2],
}

impl Pointing<'_> {
    /// Gain in a direction, dB.
    fn gain_db(&self, direction: DVec3) -> f64 {
        let cosines = self.axes.map(|axis| direction.dot(axis));
        let off = [0, 1].map(|i| self.dilation[i] * (cosines[i] - self.cosines[i]));
        value_of_two(&self.pattern.array, off) + value_of_two(&self.pattern.element, cosines)
    }

    /// Orthogonal axes: X, Y and the normal of both.
    fn frame(&self) -> Option<[DVec3; 3]> {
        let [x, y] = self.axes;
        let z = x.cross(y).try_normalize()?;
        Some([x, z.cross(x), z])
    }

    /// Main lobe over azimuth and elevation from the normal of the axes.
    fn pattern(&self) -> Option<model::Pattern> {
        let [x, y, z] = self.frame()?;
        let [left, up] = self.cosines;
        let elevation = libm::asin(up);
        let azimuth = libm::asin((left / libm::cos(elevation)).clamp(-1.0, 1.0));
        let gain_db = |azimuth: f64, elevation: f64| {
            let [sine, cosine] = [libm::sin(azimuth), libm::cos(azimuth)];
            self.gain_db((x * sine + z * cosine) * libm::cos(elevation) + y * libm::sin(elevation))
        };
        sampled(gain_db, [azimuth, elevation])
    }

    /// Main lobe over the angle from the boresight in the plane of boresight and heading; `None` if the gain does not fall by half to both sides.
    fn lobe(&self, heading: DVec3) -> Option<Lobe> {
        let middle_rad = angle_rad(self.boresight, heading);
        let aside = (self.boresight - heading * self.boresight.dot(heading)).try_normalize()?;
        let gain_db = |off_rad: f64| {
            let angle_rad = middle_rad + off_rad;
            self.gain_db(aside * libm::cos(angle_rad) + heading * libm::sin(angle_rad))
        };
        let (mut peak_rad, mut peak_db) = (0.0, gain_db(0.0));
        for side in [-1.0, 1.0] {
            for (off_rad, db) in outwards(side).map(|off_rad| (off_rad, gain_db(off_rad))) {
                if db > peak_db {
                    (peak_rad, peak_db) = (off_rad, db);
                } else if db.is_nan() || db < peak_db - HALF_POWER_DB {
                    break;
                }
            }
        }
        // Between the neighbours of the highest value: a third off either end in turn.
        let reach_rad = (STEP_GROWTH * STEP_GROWTH - 1.0) * f64::abs(peak_rad);
        let [mut low, mut high] = [peak_rad - reach_rad, peak_rad + reach_rad];
        for _ in 0..2 * BISECTIONS {
            let [first, second] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            match gain_db(first) < gain_db(second) {
                true => low = first,
                false => high = second,
            }
        }
        let peak_rad = 0.5 * (low + high);
        let edge_db = gain_db(peak_rad) - HALF_POWER_DB;
        let edge = |side: f64| {
            let mut within = peak_rad;
            for off_rad in outwards(side).map(|step| peak_rad + step) {
                if gain_db(off_rad) >= edge_db {
                    within = off_rad;
                    continue;
                }
                let mut beyond = off_rad;
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (within + beyond);
                    match gain_db(middle) >= edge_db {
                        true => within = middle,
                        false => beyond = middle,
                    }
                }
                return Some(within);
            }
            None
        };
        let [back, forward] = [edge(-1.0)?, edge(1.0)?];
        (edge_db.is_finite() && forward > back).then_some(Lobe {
            width_rad: forward - back,
            off_rad: 0.5 * (back + forward),
        })
    }
}

/// Growing steps to one side, up to a right angle.
fn outwards(side: f64) -> impl Iterator<Item = f64> {
    let steps = std::iter::successors(Some(FIRST_STEP_RAD), |step| Some(step * STEP_GROWTH));
    steps
        .take_while(|&step| step < std::f64::consts::FRAC_PI_2)
        .map(move |step| side * step)
}

/// Value of an optional switch of the XML; false for an element that lacks it.
fn switch(element: &Element, name: &'static str) -> Result<bool, MetadataError> {
    element.optional(name).map_or(Ok(false), |used| flag(&used))
}

fn flag(element: &Element) -> Result<bool, MetadataError> {
    match &*element.text() {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        other => Err(element.fault(format!("expected true or false, found '{other}'"))),
    }
}

/// Scale factors of DCX and DCY, from 0 to 1.
fn scale_factors(
    pattern: &Element,
    switch: &'static str,
    factors: &'static str,
) -> Result<[f64; 2], MetadataError> {
    let on = self::switch(pattern, switch)?;
    match pattern.optional(factors) {
        Some(factors) if on => {
            let (x, y) = factors.pair("DCXSF", "DCYSF")?;
            Ok([x, y])
        }
        _ => Ok([if on { 1.0 } else { 0.0 }; 2]),
    }
}
