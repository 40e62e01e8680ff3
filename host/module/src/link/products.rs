//! Products of a module: maps, detections, or an image that it accumulates.

use num_complex::Complex32;
use subaperture_core::cfar::{Cfar, Detection};
use subaperture_core::dpca::Dpca;
use subaperture_core::link::{
    AssembledChip, AssembledMap, ChipGrid, PixelEncoding, Report, detections,
};

use super::ending::SinkError;

/// Product requested from a module.
#[derive(Clone, Copy, Debug)]
pub enum Request<'a> {
    /// Maps of all patches.
    Maps,
    /// Detections on the maps with these settings.
    Detections(Detector),
    /// Image of all sub-CPIs.
    Image(ImageRequest<'a>),
}

/// Detector of a module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detector {
    /// Guard and training cells, and probability of a false alarm.
    pub cfar: Cfar,
    /// Clutter cancellation of the two channels of the job, if any. Its pulses need the weights of
    /// [`PulseSource::displaced`](super::PulseSource::displaced).
    pub dpca: Option<Dpca>,
}

/// Image requested from a module.
#[derive(Clone, Copy, Debug)]
pub struct ImageRequest<'a> {
    /// One chip per patch, in the order of the patches.
    pub chips: &'a [ChipGrid],
    /// Sum over the sub-CPIs.
    pub sum: ImageSum,
    /// Number of previews: images of the sub-CPIs so far, evenly distributed over the job
    /// ([`SessionObserver::preview`](super::SessionObserver::preview)). Each takes the bytes of an image. None at a fixed pulse rate or with
    /// samples from the front end of the module, which do not wait.
    pub previews: u32,
}

/// Sum of the sub-CPIs of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageSum {
    /// Coherent sum: the complex image.
    Coherent,
    /// Mean power of the images of the single sub-CPIs (noncoherent multilook, one look per sub-CPI), as real pixels.
    Power,
}

/// Requested products of a job, with the receiver of each.
pub(super) enum Products<'c> {
    Maps(&'c mut dyn MapSink),
    Detections(Detector, &'c mut dyn DetectionSink),
    Image(ImageRequest<'c>, &'c mut AccumulatedImage),
}

impl<'c> Products<'c> {
    /// Request for these products.
    pub(super) fn request(&self) -> Request<'c> {
        match self {
            Self::Maps(_) => Request::Maps,
            Self::Detections(detector, _) => Request::Detections(*detector),
            Self::Image(request, _) => Request::Image(*request),
        }
    }

    /// The same products with a shorter lifetime.
    pub(super) fn by_ref(&mut self) -> Products<'_> {
        match self {
            Self::Maps(sink) => Products::Maps(&mut **sink),
            Self::Detections(detector, sink) => Products::Detections(*detector, &mut **sink),
            Self::Image(request, image) => Products::Image(*request, image),
        }
    }
}

/// Receiver of complete maps.
pub trait MapSink {
    /// Accept a complete, requested map. Every map is passed once, in any order.
    ///
    /// # Errors
    /// An error ends the transfer.
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError>;
}

/// Sink that discards maps, for a conversation that only identifies the module.
pub(super) struct DiscardMaps;

impl MapSink for DiscardMaps {
    fn accept(&mut self, _: &AssembledMap<'_>) -> Result<(), SinkError> {
        Ok(())
    }
}

/// Detection as received: with the value of each channel's map at the nearest cell.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelDetection {
    /// Detection on the map of channel 0, or on the difference of both channels if the clutter is cancelled.
    pub detection: Detection,
    /// Values by channel, aligned if the clutter is cancelled.
    pub values: Vec<Complex32>,
}

/// Receiver of the detections of a module.
pub trait DetectionSink {
    /// Accept all detections on the map of a patch in a sub-CPI, strongest first. Every list is passed once, in any order.
    ///
    /// # Errors
    /// An error ends the transfer.
    fn accept(
        &mut self,
        sub_cpi: u32,
        patch: u16,
        detections: &[ChannelDetection],
    ) -> Result<(), SinkError>;
}

/// Image that a module has accumulated, as received.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AccumulatedImage {
    /// Sub-CPIs that the image contains, in the order in which they were added.
    pub sub_cpis: Vec<u32>,
    /// Sum of the slow-time weights of their pulses.
    pub weight_sum: f32,
    /// Number of contributions left out because a pixel lies outside the map of its patch. The image is wrong there.
    pub left_out: u64,
    /// Pixels of the chips in the order of the patches, row-major; power as real parts. `None` for a chip that was not received.
    pub chips: Vec<Option<Vec<Complex32>>>,
}

impl AccumulatedImage {
    /// Discard everything for an image of this many chips.
    pub(super) fn reset(&mut self, chips: usize) {
        *self = Self {
            chips: vec![None; chips],
            ..Self::default()
        };
    }

    /// Take the image as a preview, and forget its chips, which will be requested again.
    pub(super) fn take_preview(&mut self) -> Self {
        let chips = vec![None; self.chips.len()];
        let left_out = std::mem::take(&mut self.left_out);
        Self {
            chips: std::mem::replace(&mut self.chips, chips),
            left_out,
            ..self.clone()
        }
    }

    /// First chip that was not received.
    pub(super) fn next_chip(&self) -> Option<u16> {
        let missing = self.chips.iter().position(Option::is_none);
        missing.map(|index| index as u16)
    }

    /// Accept a requested chip. Chips of other sub-CPIs are ignored.
    pub(super) fn accept(&mut self, request: ImageRequest<'_>, chip: &AssembledChip<'_>) {
        let index = usize::from(chip.grid.patch);
        let power = chip.encoding == PixelEncoding::Power;
        let requested = request.chips.get(index) == Some(&chip.grid)
            && power == (request.sum == ImageSum::Power);
        if !requested || chip.maps as usize != self.sub_cpis.len() {
            return;
        }
        if self.chips[index].is_none() {
            self.left_out += u64::from(chip.left_out);
        }
        self.weight_sum = chip.weight_sum;
        self.chips[index] = Some(chip.pixels().collect());
    }
}

/// Reassembly of the list of detections of a map from its frames.
#[derive(Default)]
pub(super) struct DetectionAssembly {
    map: Option<u32>,
    list: Vec<ChannelDetection>,
    /// Number of complete lists, and of maps that the module reports.
    complete: u32,
    made: u32,
}

impl DetectionAssembly {
    /// Start a new run.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Set the number of maps that the module reports for the run.
    pub(super) fn finish(&mut self, maps: u32) {
        self.made = maps;
    }

    /// Number of lists lost.
    pub(super) fn lost(&self) -> u32 {
        self.made.saturating_sub(self.complete)
    }

    /// Process a report. Returns sub-CPI, patch and detections of a list that it completes.
    pub(super) fn take(&mut self, report: &Report<'_>) -> Option<(u32, u16, &[ChannelDetection])> {
        let Report::Detections {
            map,
            sub_cpi,
            patch,
            first,
            total,
            channels,
            list,
        } = *report
        else {
            return None;
        };
        if first == 0 {
            self.map = Some(map);
            self.list.clear();
        }
        if self.map != Some(map) || usize::from(first) != self.list.len() {
            self.map = None;
            return None;
        }
        let list = detections(list, channels.into());
        self.list
            .extend(list.map(|(detection, values)| ChannelDetection {
                detection,
                values: values.collect(),
            }));
        if self.list.len() < usize::from(total) {
            return None;
        }
        self.map = None;
        self.complete += 1;
        Some((sub_cpi, patch, &self.list))
    }
}
