//! Written files with their kinds, as the command lists them under `files` in its JSON results.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, Serializer};

/// Kind of a written file: its content, or its format for an image in another format. The guide explains each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum FileKind {
    /// Image: `image.npy`, or tiles in `image.zarr`.
    Image,
    /// Settings and figures in JSON.
    Record,
    /// Image or chart in PNG.
    Picture,
    /// Page or table for readers: HTML or Markdown.
    Report,
    /// Phase history of a collection, CPHD.
    #[serde(rename = "phase history")]
    PhaseHistory,
    /// Description of raw samples: TOML, or SigMF metadata.
    Recording,
    /// Samples of a SigMF recording.
    Samples,
    /// NumPy array of a recording.
    Array,
    /// Antenna positions over time, CSV.
    Track,
    /// Navigation log of a simulated vehicle: NMEA, NovAtel ASCII or SBET.
    #[serde(rename = "navigation log")]
    NavigationLog,
    /// Displacement of points over the passes, CSV.
    Displacement,
    /// Phases over pulses, CSV.
    #[serde(rename = "phase correction")]
    PhaseCorrection,
    /// Calibration of a stepped-frequency radar.
    Calibration,
    /// Range-Doppler maps of an embedded module.
    Maps,
    /// Targets detected by an embedded module, CSV.
    Detections,
    /// Moving targets of several channels, GeoJSON.
    #[serde(rename = "moving targets")]
    MovingTargets,
    /// Moving targets, STANAG 4607 packet.
    #[serde(rename = "stanag 4607")]
    Stanag4607,
    /// Plan of an image, executed by any computer.
    Plan,
    /// Timing model of a computer.
    #[serde(rename = "timing model")]
    TimingModel,
    /// Complex image in NITF, SICD.
    Sicd,
    /// Image of grey levels in NITF, SIDD.
    Sidd,
    /// Map as cloud-optimised GeoTIFF.
    Cog,
    /// Map as ground overlay for Google Earth.
    Kmz,
    /// Picture with a world file.
    Png,
    /// Stack of images in Zarr.
    Zarr,
    /// File that places or describes a map: STAC item, world file, projection file.
    Sidecar,
}

/// Written file, or folder for a Zarr store.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct WrittenFile {
    /// Path as given to the writer.
    #[serde(serialize_with = "as_text")]
    pub path: PathBuf,
    /// Kind of its content.
    pub kind: FileKind,
    /// Channels of a phase history or a described recording; empty for other files.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<ChannelSize>,
}

/// Size of a recorded channel.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ChannelSize {
    /// Identifier of the channel.
    pub channel: String,
    /// Number of its pulses.
    pub pulses: usize,
    /// Number of samples of a pulse.
    pub samples: usize,
}

impl WrittenFile {
    /// File of this kind, without channels.
    pub fn new(path: impl Into<PathBuf>, kind: FileKind) -> Self {
        Self {
            path: path.into(),
            kind,
            channels: Vec::new(),
        }
    }

    /// This file with these channels.
    #[must_use]
    pub fn with_channels(mut self, channels: Vec<ChannelSize>) -> Self {
        self.channels = channels;
        self
    }

    /// This file, whose path is relative to `folder`.
    #[must_use]
    pub fn within(mut self, folder: &Path) -> Self {
        self.path = folder.join(self.path);
        self
    }
}

fn as_text<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(&path.display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_files_with_channels_list_them() {
        let file = WrittenFile::new("image.npy", FileKind::Image).within(Path::new("a"));
        let path = Path::new("a").join("image.npy");
        let path = path.display().to_string();
        assert_eq!(json!(file), json!({ "path": path, "kind": "image" }));
        let channel = ChannelSize {
            channel: "1".to_owned(),
            pulses: 2,
            samples: 3,
        };
        let file = WrittenFile::new("a.cphd", FileKind::PhaseHistory).with_channels(vec![channel]);
        let channels = json!([{ "channel": "1", "pulses": 2, "samples": 3 }]);
        assert_eq!(
            json!(file),
            json!({ "path": "a.cphd", "kind": "phase history", "channels": channels })
        );
    }
}
