//! Metadata of the XML block needed by image formation and its record.

use std::collections::HashMap;

use glam::DVec3;

use super::antenna::{AntennaIds, Antennas};
use super::antenna_vectors::AntennaVector;
use super::conventions::{Domain, Sgn};
use super::pvp::Layout;
use crate::container::channels::{Arrays, parameters};
use crate::container::{self, Element, MetadataError, SignalFormat};
use crate::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::antenna::MountedAntennas;
use subaperture_model::geometry::{Extent, Geodetic, SceneFrame};
use subaperture_model::phase_history::{Beam, Channel, NoBeam, Pulse};

/// Surface on which image coordinates are defined. [`CphdInfo::frame`] is a plane for either.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceSurface {
    /// The plane of `uIAX` and `uIAY` through the IARP.
    Planar,
    /// Constant height above the ellipsoid. The frame is its tangent plane at the IARP, x along
    /// `uIAXLL`, y along the part of `uIAYLL` normal to x. A surface point at distance `d` lies
    /// about `d^2 / 12.8e6` m below it: 8 cm at 1 km.
    Hae,
}

/// Channel as listed in the XML.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelInfo {
    /// `Identifier`.
    pub id: String,
    /// Number of vectors (pulses).
    pub num_vectors: u64,
    /// Samples in each vector, as stored.
    pub num_samples: u64,
    /// Transmitted polarisation, such as `V`.
    pub tx_polarization: Option<String>,
    /// Received polarisation.
    pub rcv_polarization: Option<String>,
    /// Centre of the band, hertz.
    pub fx_c_hz: Option<f64>,
    /// Width of the band, hertz.
    pub fx_bw_hz: Option<f64>,
    /// Whether all vectors share one SRP.
    pub srp_fixed: Option<bool>,
    pub(super) arrays: Arrays,
    /// Antennas of the channel.
    pub(super) antennas: Option<AntennaIds>,
}

impl ChannelInfo {
    /// Description of the channel.
    pub fn about(&self) -> Channel {
        let known = |letter: &Option<String>| letter.clone().filter(|text| text != "UNSPECIFIED");
        let [transmitted, received] = [&self.tx_polarization, &self.rcv_polarization].map(known);
        Channel::new(self.id.clone()).polarized(transmitted, received)
    }
}

/// Metadata of a CPHD file. Text is as in the file. Elements that the standard requires but image formation does not
/// need are optional.
#[derive(Clone, Debug, PartialEq)]
pub struct CphdInfo {
    /// Version, such as `1.1.0`.
    pub version: String,
    /// Radar platform.
    pub collector_name: Option<String>,
    /// Transmitting platform, if it differs.
    pub illuminator_name: Option<String>,
    /// Name of the collection.
    pub core_name: Option<String>,
    /// `MONOSTATIC` or `BISTATIC`.
    pub collect_type: Option<String>,
    /// `SPOTLIGHT`, `STRIPMAP` or `DYNAMIC STRIPMAP`.
    pub mode_type: Option<String>,
    /// The radar's own name of its mode.
    pub mode_id: Option<String>,
    /// Classification banner.
    pub classification: Option<String>,
    /// Release restrictions (`ReleaseInfo`).
    pub release_info: Option<String>,
    /// Domain of the stored samples. Samples are always delivered as FX.
    pub domain: Domain,
    /// Sign of the stored samples. Samples are always delivered with -1.
    pub sgn: Sgn,
    /// Date and time to which all times refer, ISO 8601.
    pub collection_start: Option<String>,
    /// First and last transmit time, seconds.
    pub tx_time_s: Option<(f64, f64)>,
    /// Lowest and highest frequency of all channels, hertz.
    pub fx_band_hz: Option<(f64, f64)>,
    /// Earliest and latest time of arrival of all channels, seconds after the SRP's.
    pub toa_swath_s: Option<(f64, f64)>,
    /// Scene frame: origin at the IARP, x and y along `uIAX` and `uIAY`.
    pub frame: SceneFrame,
    /// The IARP by latitude, longitude and height, computed from its ECF position.
    pub iarp: Geodetic,
    /// Kind of reference surface.
    pub surface: ReferenceSurface,
    /// Image area in the scene frame.
    pub image_area: Extent,
    /// Storage format of samples.
    pub signal_format: SignalFormat,
    /// Name of the compression, if the signal arrays are compressed; they cannot be read then.
    pub compression: Option<String>,
    /// Identifier of the reference channel.
    pub ref_channel: String,
    /// All channels, in the order of the file.
    pub channels: Vec<ChannelInfo>,
    /// Antenna patterns of all channels.
    pub(super) antennas: Antennas,
}

/// Middle frequency of a channel; `None` without pulses.
fn centre_hz(channel: &ChannelInfo, pulses: &[Pulse], samples: usize) -> Option<f64> {
    let middle = pulses.get(pulses.len() / 2)?;
    let stated_hz = channel.fx_c_hz.filter(|hz| *hz > 0.0);
    Some(stated_hz.unwrap_or_else(|| middle.frequency_hz(samples / 2)))
}

impl CphdInfo {
    /// Parse the XML block of a CPHD file, or an XML file of the same content. The positions of per-vector parameters
    /// are checked by [`super::Cphd::open`].
    ///
    /// # Errors
    /// [`MetadataError`] names the first element that is missing or wrong.
    pub fn from_xml(xml: &str) -> Result<Self, MetadataError> {
        parse(xml, DEFAULT_MEMORY_BYTES).map(|(info, _)| info)
    }

    /// Beam of a channel along the track of these pulses, if the file gives antenna patterns for it.
    ///
    /// # Errors
    /// [`NoBeam`]. [`Self::unused_patterns`] states faults of the patterns.
    pub(super) fn beam(
        &self,
        channel: &ChannelInfo,
        pulses: &[Pulse],
        vectors: Option<&[[AntennaVector; 2]]>,
        samples: usize,
    ) -> Result<Option<Beam>, NoBeam> {
        let (Some(centre_hz), Some(ids)) = (centre_hz(channel, pulses, samples), &channel.antennas)
        else {
            return Ok(None);
        };
        self.antennas
            .beam(ids, &self.frame, pulses, vectors, centre_hz)
    }

    /// Antennas of a channel with their attitudes at these pulses; arguments as of [`Self::beam`].
    pub(super) fn mounted(
        &self,
        channel: &ChannelInfo,
        pulses: &[Pulse],
        vectors: Option<&[[AntennaVector; 2]]>,
        samples: usize,
    ) -> Option<MountedAntennas> {
        let centre_hz = centre_hz(channel, pulses, samples)?;
        let ids = channel.antennas.as_ref()?;
        self.antennas
            .mounted(ids, &self.frame, pulses, vectors, centre_hz)
    }

    /// Whether the beam of a channel needs the antenna axes or boresights of each vector.
    pub(super) fn needs_antenna_vectors(&self, channel: &ChannelInfo) -> bool {
        let ids = channel.antennas.as_ref();
        ids.is_some_and(|ids| self.antennas.needs_vectors(ids))
    }

    /// Warning that the antenna patterns of a channel are not used, with the reason. `without_vectors` is the fault of antenna axes per vector.
    pub(super) fn unused_patterns(
        &self,
        channel: &ChannelInfo,
        without_vectors: Option<&str>,
    ) -> Option<String> {
        let ids = channel.antennas.as_ref()?;
        let fault = self.antennas.fault(ids, without_vectors)?;
        Some(format!(
            "channel {}: its antenna patterns are not used: {fault}",
            channel.id
        ))
    }
}

/// Metadata, and the positions of the per-vector parameters.
pub(super) fn parse(
    xml: &str,
    memory_bytes: u64,
) -> Result<(CphdInfo, Result<Layout, MetadataError>), MetadataError> {
    let document = container::parse(xml, memory_bytes)?;
    let root = Element::root(&document);
    if root.name() != "CPHD" {
        return Err(root.fault("expected the root element CPHD"));
    }
    let version = root.namespace().rsplit('/').next().unwrap_or_default();

    let global = root.child("Global")?;
    let (domain, sgn) = (domain(&global)?, sgn(&global)?);
    let optional_pair = |parent: Option<Element>, first, second| -> Result<_, MetadataError> {
        parent.map(|e| e.pair(first, second)).transpose()
    };
    let timeline = global.optional("Timeline");
    let collection_start = timeline
        .as_ref()
        .and_then(|t| t.optional_text("CollectionStart"));

    let scene = root.child("SceneCoordinates")?;
    let (frame, iarp, surface) = scene_frame(&scene)?;
    let image_area = image_area(&scene.child("ImageArea")?)?;

    let data = root.child("Data")?;
    let signal_format = SignalFormat::of(&data)?;
    let channel_node = root.child("Channel")?;
    let channels = channel_infos(data, channel_node)?;

    let collection = root.optional("CollectionID");
    let of_collection = |name| collection.as_ref().and_then(|c| c.optional_text(name));
    let mode = collection.as_ref().and_then(|c| c.optional("RadarMode"));
    let info = CphdInfo {
        version: version.to_owned(),
        collector_name: of_collection("CollectorName"),
        illuminator_name: of_collection("IlluminatorName"),
        core_name: of_collection("CoreName"),
        collect_type: of_collection("CollectType"),
        mode_type: mode.as_ref().and_then(|m| m.optional_text("ModeType")),
        mode_id: mode.as_ref().and_then(|m| m.optional_text("ModeID")),
        classification: of_collection("Classification"),
        release_info: of_collection("ReleaseInfo"),
        domain,
        sgn,
        collection_start,
        tx_time_s: optional_pair(timeline, "TxTime1", "TxTime2")?,
        fx_band_hz: optional_pair(global.optional("FxBand"), "FxMin", "FxMax")?,
        toa_swath_s: optional_pair(global.optional("TOASwath"), "TOAMin", "TOAMax")?,
        frame,
        iarp,
        surface,
        image_area,
        signal_format,
        compression: data.optional_text("SignalCompressionID"),
        ref_channel: channel_node.child("RefChId")?.text().into_owned(),
        channels,
        antennas: Antennas::of(&root),
    };
    let layout = root
        .child("PVP")
        .and_then(|pvp| Layout::parse(&pvp, &data.child("NumBytesPVP")?));
    Ok((info, layout))
}

fn domain(global: &Element) -> Result<Domain, MetadataError> {
    let domain = global.child("DomainType")?;
    match &*domain.text() {
        "FX" => Ok(Domain::Fx),
        "TOA" => Ok(Domain::Toa),
        other => Err(domain.fault(format!("expected FX or TOA, found '{other}'"))),
    }
}

fn sgn(global: &Element) -> Result<Sgn, MetadataError> {
    let sgn = global.child("SGN")?;
    match &*sgn.text() {
        "-1" => Ok(Sgn::Minus),
        "+1" | "1" => Ok(Sgn::Plus),
        other => Err(sgn.fault(format!("expected -1 or +1, found '{other}'"))),
    }
}

/// All channels of the file, at least one.
fn channel_infos(data: Element, channel_node: Element) -> Result<Vec<ChannelInfo>, MetadataError> {
    let parameters = parameters(channel_node);
    let channels: Vec<ChannelInfo> = data
        .children("Channel")
        .map(|entry| channel_info(&entry, &parameters))
        .collect::<Result<_, _>>()?;
    if channels.is_empty() {
        return Err(data.fault("no element Channel: the file contains no phase history"));
    }
    Ok(channels)
}

fn channel_info(
    entry: &Element,
    all: &HashMap<String, Element>,
) -> Result<ChannelInfo, MetadataError> {
    let id = entry.child("Identifier")?.text().into_owned();
    let parameters = all.get(&id);
    let number = |name| -> Result<Option<f64>, MetadataError> {
        let element = parameters.and_then(|p| p.optional(name));
        element.map(|e| e.number()).transpose()
    };
    let polarization = parameters.and_then(|p| p.optional("Polarization"));
    let of_polarization = |name| polarization.as_ref().and_then(|p| p.optional_text(name));
    let arrays = Arrays::of(*entry)?;
    Ok(ChannelInfo {
        num_vectors: arrays.num_vectors,
        num_samples: arrays.num_samples,
        tx_polarization: of_polarization("TxPol"),
        rcv_polarization: of_polarization("RcvPol"),
        fx_c_hz: number("FxC")?,
        fx_bw_hz: number("FxBW")?,
        srp_fixed: parameters
            .and_then(|p| p.optional("SRPFixed"))
            .map(|e| matches!(&*e.text(), "true" | "1")),
        arrays,
        antennas: parameters.and_then(AntennaIds::of),
        id,
    })
}

/// Maximum deviation of the axes from orthonormal. Axes within it are used unchanged, so that a written file reads
/// back to the same frame.
const AXIS_TOLERANCE: f64 = 1e-6;

/// The scene frame of `SceneCoordinates`, the IARP and the kind of surface.
pub(crate) fn scene_frame(
    scene: &Element,
) -> Result<(SceneFrame, Geodetic, ReferenceSurface), MetadataError> {
    let iarp_node = scene.child("IARP")?.child("ECF")?;
    let origin = iarp_node.xyz()?;
    let iarp = Geodetic::from_ecf_m(origin);
    if !(iarp.latitude_deg.is_finite() && origin.length() > 1e6) {
        return Err(iarp_node.fault("expected a position near the Earth's surface"));
    }
    let surface = scene.child("ReferenceSurface")?;
    let (x, y, kind) = if let Some(planar) = surface.optional("Planar") {
        let x = planar.child("uIAX")?.xyz()?;
        let y = planar.child("uIAY")?.xyz()?;
        let error = (x.length() - 1.0)
            .abs()
            .max((y.length() - 1.0).abs())
            .max(x.dot(y).abs());
        // Numbers are finite here, but their squares may overflow.
        if error.is_nan() || error > AXIS_TOLERANCE {
            return Err(planar.fault(format!(
                "uIAX and uIAY are not orthogonal unit vectors (off by {error:.1e})"
            )));
        }
        (x, y, ReferenceSurface::Planar)
    } else if let Some(hae) = surface.optional("HAE") {
        let axis = |name| -> Result<DVec3, MetadataError> {
            let (d_latitude, d_longitude) = hae.child(name)?.pair("Lat", "Lon")?;
            Ok(iarp.direction(d_latitude, d_longitude).normalize_or_zero())
        };
        let (x, along_y) = (axis("uIAXLL")?, axis("uIAYLL")?);
        let y = (along_y - x * x.dot(along_y)).normalize_or_zero();
        // Parallel axes leave rounding only, far from unit length before normalising.
        if x.cross(along_y).length() < AXIS_TOLERANCE || y == DVec3::ZERO {
            return Err(hae.fault("uIAXLL and uIAYLL are parallel or zero"));
        }
        (x, y, ReferenceSurface::Hae)
    } else {
        return Err(surface.fault("expected Planar or HAE"));
    };
    let frame = SceneFrame::Earth {
        origin_ecf_m: origin,
        x_axis_ecf: x,
        y_axis_ecf: y,
    };
    Ok((frame, iarp, kind))
}

/// The rectangle of `ImageArea`.
pub(crate) fn image_area(area: &Element) -> Result<Extent, MetadataError> {
    let (x1, y1) = area.child("X1Y1")?.pair("X", "Y")?;
    let (x2, y2) = area.child("X2Y2")?.pair("X", "Y")?;
    if x1 < x2 && y1 < y2 {
        Ok(Extent {
            x_m: (x1, x2),
            y_m: (y1, y2),
        })
    } else {
        Err(area.fault("expected X1Y1 below X2Y2 in both coordinates"))
    }
}
