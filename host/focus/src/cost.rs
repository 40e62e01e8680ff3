//! What forming an image takes, as a former counts it from what it has decided.
//!
//! **Operations** are real additions, multiplications and roots, one each; a phasor is 20, a transform of `n` is
//! `5 n log2 n`. Each former's documentation has its own formula. Neglected: reading files, tables made once, and that
//! transforms are rounded up to fast lengths (a few per cent). Counts are not times: transforms run at several times the
//! speed of scattered reads.
//!
//! **Tiles.** What is done once for all pixels, however few are formed (profiles, maps, a spectrum), a tile that is formed
//! alone takes whole; of the rest it takes its share.
//!
//! **Buffers** are those beside the pixels themselves (8 bytes each) and the recording; of each is said how often it is
//! there. Formers take smaller ones where memory is short, but for the tables.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// What forming an image takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Real operations for all of the image, formed in one pass over the pulses.
    pub operations: f64,
    /// Of these, those that any tile takes, however small, if it is formed alone.
    pub shared_operations: f64,
    /// What that is made of, one after another.
    pub stages: Vec<StageCost>,
    /// What is held beside pixels and recording.
    pub buffers: Vec<Buffer>,
}

/// What a stage of forming takes. While an image is formed its monitor is told of the stage by the same name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageCost {
    /// Its name.
    pub name: Cow<'static, str>,
    /// Real operations for all of the image.
    pub operations: f64,
    /// Time of one core, seconds, by the time model.
    pub core_s: f64,
    /// Whether any tile takes it whole.
    pub shared: bool,
}

impl StageCost {
    /// A stage of so many operations and nanoseconds of one core, of which tiles take their share.
    pub fn new(name: &'static str, operations: f64, core_ns: f64) -> Self {
        Self {
            name: name.into(),
            // Parts of operations say nothing.
            operations: operations.round(),
            core_s: 1e-9 * core_ns,
            shared: false,
        }
    }

    /// One that any tile takes whole.
    pub fn shared(name: &'static str, operations: f64, core_ns: f64) -> Self {
        Self {
            shared: true,
            ..Self::new(name, operations, core_ns)
        }
    }
}

/// A buffer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Buffer {
    /// What it holds.
    pub name: Cow<'static, str>,
    /// How often it is there.
    pub each: Each,
    /// Bytes of one.
    pub bytes: u64,
}

/// How often a buffer is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Each {
    /// Once, for all tiles and threads.
    Image,
    /// Once for a pass over the pulses.
    Pass,
    /// Once a thread.
    Thread,
    /// By the pixels in hand: the bytes are those of all the image's.
    Pixels,
}

impl Cost {
    /// Of these stages.
    pub fn of(stages: impl IntoIterator<Item = StageCost>) -> Self {
        let stages: Vec<StageCost> = stages.into_iter().collect();
        let shared = stages.iter().filter(|stage| stage.shared);
        Self {
            operations: stages.iter().map(|stage| stage.operations).sum(),
            shared_operations: shared.map(|stage| stage.operations).sum(),
            stages,
            buffers: Vec::new(),
        }
    }

    /// Seconds of one core for all of the image, by the time model.
    pub fn core_s(&self) -> f64 {
        self.stages.iter().map(|stage| stage.core_s).sum()
    }

    /// With a buffer of so many bytes more.
    #[must_use]
    pub fn holding(mut self, name: &'static str, each: Each, bytes: f64) -> Self {
        self.buffers.push(Buffer {
            name: name.into(),
            each,
            bytes: bytes as u64,
        });
        self
    }

    /// Operations for a tile alone, of `share` of the image's pixels (0 to 1).
    pub fn tile_operations(&self, share: f64) -> f64 {
        self.shared_operations + share * (self.operations - self.shared_operations)
    }

    /// Bytes of all buffers, one thread at work on `share` of the image's pixels (0 to 1).
    pub fn bytes(&self, share: f64) -> u64 {
        let bytes = self.buffers.iter().map(|buffer| match buffer.each {
            Each::Pixels => (share * buffer.bytes as f64) as u64,
            _ => buffer.bytes,
        });
        bytes.fold(0, u64::saturating_add)
    }
}

/// Operations of a transform.
pub(crate) fn transform(length: f64) -> f64 {
    5.0 * length * libm::log2(length.max(2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_alone_takes_what_is_shared_whole() {
        let all = StageCost::shared("tables", 400.2, 1e9);
        let cost = Cost::of([all, StageCost::new("sums", 599.8, 2e9)])
            .holding("tables", Each::Image, 100.0)
            .holding("sums", Each::Pixels, 40.0);
        assert_eq!(cost.operations, 1000.0);
        assert_eq!(cost.core_s(), 3.0);
        assert_eq!(cost.tile_operations(0.0), 400.0);
        assert_eq!(cost.tile_operations(0.5), 700.0);
        assert_eq!(cost.tile_operations(1.0), 1000.0);
        assert_eq!([cost.bytes(1.0), cost.bytes(0.25)], [140, 110]);
        let text = serde_json::to_string(&cost).unwrap();
        assert_eq!(serde_json::from_str::<Cost>(&text).unwrap(), cost);
    }
}
