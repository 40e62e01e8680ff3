//! Trajectories of transmitter and receiver of a bistatic image (`Position/TxAPCPoly`, `RcvAPC`, `GRPPoly`).
//!
//! A signal scattered at the ground reference point (GRP) `G` at time `t` is transmitted and received at
//!
//! ```text
//! t_x = t - |X(t) - G(t)| / c,    t_r = t + |R(t) - G(t)| / c
//! ```
//!
//! The aperture reference point (ARP) lies on the bisector of the directions from the GRP to both antennas, at the mean of their ranges.

use std::collections::BTreeMap;

use glam::DVec3;

use subaperture_io::container::{Element, MetadataError};
use subaperture_model::SPEED_OF_LIGHT_M_S;

use crate::contour::{Antenna, Sensor};
use crate::lookup;
use crate::polynomial::Path;

/// Shortest bisector, half of the sum of the unit vectors to both antennas: a bistatic angle of 169 degrees.
const MIN_BISECTOR: f64 = 0.1;
/// Smallest sine of the angle between the velocity of the ARP and the line of sight.
const MIN_TURN: f64 = 1e-6;

/// Trajectories over the time from the start of collection, ECF.
#[derive(Clone, Debug)]
pub(crate) struct Pair {
    pub(crate) transmitter: Path,
    pub(crate) receiver: Path,
    /// Ground reference point (GRP).
    pub(crate) reference: Path,
}

impl Pair {
    /// Parse `Position`. The mean of the polynomials of several receivers is used.
    pub(crate) fn parse(root: Element) -> Result<Self, MetadataError> {
        let path = |name| lookup::path(root.at(&["Position", name])?);
        Ok(Self {
            transmitter: path("TxAPCPoly")?,
            receiver: receiver(root)?,
            reference: path("GRPPoly")?,
        })
    }

    /// Times of transmission and reception of a signal that is scattered at a time, seconds.
    pub(crate) fn times_s(&self, time_s: f64) -> [f64; 2] {
        let reference = self.reference.at(time_s, 0);
        let delay_s = |path: &Path| path.at(time_s, 0).distance(reference) / SPEED_OF_LIGHT_M_S;
        [
            time_s - delay_s(&self.transmitter),
            time_s + delay_s(&self.receiver),
        ]
    }

    /// Both antennas for a signal that is scattered at a time.
    pub(crate) fn at(&self, time_s: f64) -> Sensor {
        let [sent_s, received_s] = self.times_s(time_s);
        let antenna = |path: &Path, time_s: f64| Antenna {
            place: path.at(time_s, 0),
            velocity: path.at(time_s, 1),
        };
        Sensor {
            transmitter: antenna(&self.transmitter, sent_s),
            receiver: Some(antenna(&self.receiver, received_s)),
        }
    }
}

/// Children of a name by their `index` attribute.
fn indexed<'a, 'i>(parent: Element<'a, 'i>, name: &str) -> BTreeMap<String, Element<'a, 'i>> {
    let children = parent.elements().filter(|child| child.name() == name);
    let with_index = |child: Element<'a, 'i>| Some((child.attribute("index")?.to_owned(), child));
    children.filter_map(with_index).collect()
}

/// Mean of the polynomials of the receivers that the image is formed from.
fn receiver(root: Element) -> Result<Path, MetadataError> {
    let all = root.at(&["Position", "RcvAPC"])?;
    let channels = root.at(&["RadarCollection", "RcvChannels"])?;
    let processed = root.at(&["ImageFormation", "RcvChanProc"])?;
    let (antennas, parameters) = (
        indexed(all, "RcvAPCPoly"),
        indexed(channels, "ChanParameters"),
    );
    let none = |parent: Element, name: &str, index: &str| {
        parent.fault(format!("expected {name} of index {index}, found none"))
    };
    // Number of channels of each antenna.
    let mut used = BTreeMap::new();
    for channel in processed.children("ChanIndex") {
        let index = channel.text();
        let parameters = parameters.get(&*index);
        let parameters = parameters.ok_or_else(|| none(channels, "ChanParameters", &index))?;
        let antenna = parameters.child("RcvAPCIndex")?.text().into_owned();
        *used.entry(antenna).or_insert(0usize) += 1;
    }
    let count = used.values().sum::<usize>();
    if count == 0 {
        return Err(processed.fault("expected ChanIndex, found none"));
    }
    let mut mean: Vec<DVec3> = Vec::new();
    for (index, channels) in used {
        let element = antennas.get(&index);
        let path = lookup::path(*element.ok_or_else(|| none(all, "RcvAPCPoly", &index))?)?;
        let most = mean.len().max(path.coefficients.len());
        mean.resize(most, DVec3::ZERO);
        for (sum, c) in mean.iter_mut().zip(&path.coefficients) {
            *sum += *c * (channels as f64 / count as f64);
        }
    }
    Ok(Path {
        coefficients: mean,
        off_m: 0.0,
    })
}

/// Trajectories fitted to the recorded positions of pulses.
pub(crate) struct Fitted {
    pub(crate) pair: Pair,
    /// Aperture reference point (ARP).
    pub(crate) path: Path,
    /// Time at the scene of the middle of the recording, seconds.
    pub(crate) coa_s: f64,
    /// Time of the last reception, seconds.
    pub(crate) duration_s: f64,
}

impl Fitted {
    /// Fit times of transmission from the first, seconds, and positions of both antennas at transmission and reception, ECF; `scp` is the GRP. The error says why
    /// SICD cannot describe the aperture.
    pub(crate) fn new(
        sent_s: &[f64],
        places_m: &[[DVec3; 2]],
        scp: DVec3,
    ) -> Result<Self, &'static str> {
        let (mut scattered_s, mut received_s, mut reference) = (vec![], vec![], vec![]);
        for (&sent_s, antennas) in sent_s.iter().zip(places_m) {
            let sights = antennas.map(|place| place - scp);
            let ranges_m = sights.map(DVec3::length);
            let [to_transmitter, to_receiver] = [0, 1].map(|k| sights[k] / ranges_m[k]);
            let bisector = 0.5 * (to_transmitter + to_receiver);
            // Also refuses positions that are not finite.
            if bisector.length().partial_cmp(&MIN_BISECTOR) != Some(std::cmp::Ordering::Greater) {
                return Err(
                    "transmitter and receiver lie in opposite directions from the scene: expected a bistatic angle below 168 degrees",
                );
            }
            let mean_m = 0.5 * (ranges_m[0] + ranges_m[1]);
            let scattered = sent_s + ranges_m[0] / SPEED_OF_LIGHT_M_S;
            scattered_s.push(scattered);
            received_s.push(scattered + ranges_m[1] / SPEED_OF_LIGHT_M_S);
            reference.push(scp + bisector.normalize() * mean_m);
        }
        let of = |k: usize| places_m.iter().map(|places| places[k]).collect::<Vec<_>>();
        let fit = |times_s: &[f64], places: &[DVec3]| {
            Path::through(times_s, places).ok_or("no polynomial fits the antennas' trajectories")
        };
        let fitted = Self {
            pair: Pair {
                transmitter: fit(sent_s, &of(0))?,
                receiver: fit(&received_s, &of(1))?,
                reference: Path {
                    coefficients: vec![scp],
                    off_m: 0.0,
                },
            },
            path: fit(&scattered_s, &reference)?,
            coa_s: 0.5 * (scattered_s[0] + scattered_s[scattered_s.len() - 1]),
            duration_s: received_s[received_s.len() - 1],
        };
        let sight = (scp - fitted.path.at(fitted.coa_s, 0)).normalize();
        let heading = fitted.path.at(fitted.coa_s, 1).normalize_or_zero();
        match heading.cross(sight).length() > MIN_TURN {
            true => Ok(fitted),
            false => Err(
                "the bisector of transmitter and receiver does not turn at the centre of aperture; SICD cannot describe it",
            ),
        }
    }
}
