//! Metadata of the XML needed by image formation and its record.

use std::collections::HashMap;

use super::header::Kind;
use super::pulses;
use super::vectors;
use crate::container::channels::{Arrays, parameters};
use crate::container::{self, Element, MetadataError, SignalFormat};
use crate::cphd::metadata::{image_area, scene_frame};
use glam::DVec3;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::Channel;

/// One channel.
#[derive(Clone, Debug, PartialEq)]
pub struct CrsdChannel {
    /// `ChId`.
    pub id: String,
    /// Number of vectors.
    pub num_vectors: u64,
    /// Samples in each vector.
    pub num_samples: u64,
    /// Transmitted polarisation.
    pub tx_polarization: Option<String>,
    /// Received polarisation.
    pub rcv_polarization: Option<String>,
    /// Sampling rate in hertz.
    pub sample_rate_hz: f64,
    /// Identifier of the transmit sequence that the channel received.
    pub tx_id: String,
    pub(super) arrays: Arrays,
    /// Index of the transmit sequence in the list.
    pub(super) sequence: usize,
}

impl CrsdChannel {
    /// Description of the channel.
    pub fn about(&self) -> Channel {
        Channel::new(self.id.clone())
            .polarized(self.tx_polarization.clone(), self.rcv_polarization.clone())
    }
}

/// A transmit sequence.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sequence {
    pub(super) id: String,
    pub(super) num_pulses: u64,
    /// Bytes from the beginning of the PPP block.
    pub(super) offset: u64,
}

/// Metadata of a `CRSDsar` file.
#[derive(Clone, Debug, PartialEq)]
pub struct CrsdInfo {
    /// Version, such as `1.0`.
    pub version: String,
    /// `ProductName`.
    pub product_name: Option<String>,
    /// Name of the transmitting platform.
    pub transmitter_name: Option<String>,
    /// Name of the receiving platform.
    pub receiver_name: Option<String>,
    /// `MONOSTATIC` or `BISTATIC`.
    pub collect_type: Option<String>,
    /// `SPOTLIGHT`, `STRIPMAP` or `DYNAMIC STRIPMAP`.
    pub mode_type: Option<String>,
    /// Date and time to which all times refer, ISO 8601.
    pub collection_start: Option<String>,
    /// Scene frame: origin at the IARP, x and y along `uIAX` and `uIAY`.
    pub frame: SceneFrame,
    /// Image area in the scene frame.
    pub image_area: Extent,
    /// Reference point in metres in the scene frame.
    pub reference_m: DVec3,
    /// Storage format of samples.
    pub signal_format: SignalFormat,
    /// Identifier of the reference channel.
    pub ref_channel: String,
    /// All channels, in the order of the file.
    pub channels: Vec<CrsdChannel>,
    /// Number of antenna patterns (`Antenna/AntPattern`). They are sampled arrays, which are not read.
    pub num_antenna_patterns: u64,
    pub(super) compression: Option<String>,
    pub(super) waveform: String,
    pub(super) sequences: Vec<Sequence>,
}

/// Metadata, and the positions of the parameters of pulses and vectors.
pub(super) struct Parsed {
    pub(super) info: CrsdInfo,
    pub(super) pulses: pulses::Layout,
    pub(super) vectors: vectors::Layout,
}

/// Parse the XML block.
pub(super) fn parse(xml: &str, version: &str, memory_bytes: u64) -> Result<Parsed, MetadataError> {
    let document = container::parse(xml, memory_bytes)?;
    let root = Element::root(&document);
    if Kind::of(root.name()) != Some(Kind::Sar) {
        return Err(root.fault("expected the root element CRSDsar"));
    }
    let scene = root.child("SceneCoordinates")?;
    let (frame, _, _) = scene_frame(&scene)?;
    let data = root.child("Data")?;
    let (sent, received) = (data.child("Transmit")?, data.child("Receive")?);
    let sequences = sent
        .children("TxSequence")
        .map(|entry| {
            Ok(Sequence {
                id: entry.child("TxId")?.text().into_owned(),
                num_pulses: entry.child("NumPulses")?.count()?,
                offset: entry.child("PPPArrayByteOffset")?.count()?,
            })
        })
        .collect::<Result<Vec<_>, MetadataError>>()?;
    let channel_node = root.child("Channel")?;
    let named = Named::of(&channel_node, &sequences);
    let channels = received
        .children("Channel")
        .map(|entry| channel(&entry, &channel_node, &named))
        .collect::<Result<Vec<_>, _>>()?;
    if channels.is_empty() {
        return Err(received.fault("no element Channel: the file contains no echoes"));
    }
    let text_in = |outer: &'static str, inner: &'static str| {
        root.optional(outer)
            .and_then(|node| node.optional_text(inner))
    };
    let mode = root
        .optional("SARInfo")
        .and_then(|info| info.optional("RadarMode"));
    let compression = received.optional("SignalCompression");
    let reference = root.child("ReferenceGeometry")?.child("RefPoint")?;
    let info = CrsdInfo {
        version: version.to_owned(),
        product_name: text_in("ProductInfo", "ProductName"),
        transmitter_name: text_in("TransmitInfo", "SensorName"),
        receiver_name: text_in("ReceiveInfo", "SensorName"),
        collect_type: text_in("SARInfo", "CollectType"),
        mode_type: mode.and_then(|mode| mode.optional_text("ModeType")),
        collection_start: text_in("Global", "CollectionRefTime"),
        frame,
        image_area: image_area(&scene.child("ImageArea")?)?,
        reference_m: frame.from_ecf_m(reference.child("ECF")?.xyz()?),
        signal_format: SignalFormat::of(&received)?,
        ref_channel: channel_node.child("RefChId")?.text().into_owned(),
        channels,
        num_antenna_patterns: root
            .optional("Antenna")
            .map_or(0, |antenna| antenna.children("AntPattern").count() as u64),
        compression: compression.map(|node| node.optional_text("Identifier").unwrap_or_default()),
        waveform: root
            .child("TxSequence")?
            .child("TxWFType")?
            .text()
            .into_owned(),
        sequences,
    };
    Ok(Parsed {
        info,
        pulses: pulses::Layout::parse(&root.child("PPP")?, &sent.child("NumBytesPPP")?)?,
        vectors: vectors::Layout::parse(&root.child("PVP")?, &received.child("NumBytesPVP")?)?,
    })
}

/// Elements that channels refer to by name. A search per channel would be quadratic in their number.
struct Named<'s, 'a, 'i> {
    parameters: HashMap<String, Element<'a, 'i>>,
    sequences: HashMap<&'s str, usize>,
}

impl<'s, 'a, 'i> Named<'s, 'a, 'i> {
    fn of(channels: &Element<'a, 'i>, sequences: &'s [Sequence]) -> Self {
        let numbered = sequences.iter().enumerate();
        Self {
            parameters: parameters(*channels),
            sequences: numbered
                .map(|(n, sequence)| (sequence.id.as_str(), n))
                .collect(),
        }
    }
}

fn channel(entry: &Element, all: &Element, named: &Named) -> Result<CrsdChannel, MetadataError> {
    let id = entry.child("ChId")?.text().into_owned();
    let parameters = named
        .parameters
        .get(&id)
        .ok_or_else(|| all.fault(format!("no Parameters of the channel '{id}'")))?;
    let polarization = |node: Option<Element>| node.and_then(|p| p.optional_text("PolarizationID"));
    let imaging = parameters.child("SARImage")?;
    let tx = imaging.child("TxId")?;
    let tx_id = tx.text().into_owned();
    let sequence = *named
        .sequences
        .get(tx_id.as_str())
        .ok_or_else(|| tx.fault(format!("transmit sequence '{tx_id}' is missing")))?;
    let arrays = Arrays::of(*entry)?;
    let rate = parameters.child("Fs")?;
    let sample_rate_hz = rate.number()?;
    if sample_rate_hz <= 0.0 {
        return Err(rate.fault(format!(
            "expected a positive sampling rate, found {sample_rate_hz:?} Hz"
        )));
    }
    Ok(CrsdChannel {
        num_vectors: arrays.num_vectors,
        num_samples: arrays.num_samples,
        tx_polarization: polarization(imaging.optional("TxPolarization")),
        rcv_polarization: polarization(parameters.optional("RcvPolarization")),
        sample_rate_hz,
        tx_id,
        arrays,
        sequence,
        id,
    })
}
