//! Operations, time and memory of forming an image, computed by a former from its plan.
//!
//! **Operations** are real additions, multiplications and roots, counted as one each. A phasor counts 20, a transform of length `n`
//! `5 n log2 n`. The documentation of each former contains its formula. Neglected: reading files, tables made once, and the
//! rounding of transform lengths to fast ones (a few per cent). Operations are not proportional to time: transforms run at several times the
//! speed of scattered reads.
//!
//! **Tiles.** Work shared by all pixels (profiles, maps, a spectrum) counts in full for a tile formed
//! alone; other work counts in proportion to its pixels.
//!
//! **Buffers** exclude the pixels (8 bytes each) and the recording. Each buffer states how many copies
//! exist. Formers use smaller buffers where memory is short, except for tables.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// Cost of forming an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Real operations for the whole image, formed in one pass over the pulses.
    pub operations: f64,
    /// Part of `operations` that every tile takes in full if it is formed alone.
    pub shared_operations: f64,
    /// Costs of the stages, in order of execution.
    pub stages: Vec<StageCost>,
    /// Buffers in addition to pixels and recording.
    pub buffers: Vec<Buffer>,
}

/// Cost of a stage of image formation. The monitor receives the same stage name while the image is formed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageCost {
    /// Name of the stage.
    pub name: Cow<'static, str>,
    /// Real operations for the whole image.
    pub operations: f64,
    /// Time on one core, seconds, by the timing model.
    pub core_s: f64,
    /// Whether every tile takes the stage in full.
    pub shared: bool,
}

impl StageCost {
    /// Cost of a stage divided among tiles, from its operations and nanoseconds on one core.
    pub fn new(name: &'static str, operations: f64, core_ns: f64) -> Self {
        Self {
            name: name.into(),
            // Fractions of an operation carry no information.
            operations: operations.round(),
            core_s: 1e-9 * core_ns,
            shared: false,
        }
    }

    /// Cost of a stage that every tile takes in full.
    pub fn shared(name: &'static str, operations: f64, core_ns: f64) -> Self {
        Self {
            shared: true,
            ..Self::new(name, operations, core_ns)
        }
    }
}

/// Buffer held while an image is formed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Buffer {
    /// Content of the buffer.
    pub name: Cow<'static, str>,
    /// Number of copies.
    pub each: Copies,
    /// Size of one copy, bytes.
    pub bytes: u64,
}

/// Number of copies of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Copies {
    /// One for all tiles and threads.
    Image,
    /// One per pass over the pulses.
    Pass,
    /// One per thread.
    Thread,
    /// Proportional to the pixels being formed; the size is that for the whole image.
    Pixels,
}

impl Cost {
    /// Cost of the given stages without buffers.
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

    /// Time on one core for the whole image, seconds, by the timing model.
    pub fn core_s(&self) -> f64 {
        self.stages.iter().map(|stage| stage.core_s).sum()
    }

    /// Add a buffer of the given size.
    #[must_use]
    pub fn holding(mut self, name: &'static str, each: Copies, bytes: f64) -> Self {
        self.buffers.push(Buffer {
            name: name.into(),
            each,
            bytes: bytes as u64,
        });
        self
    }

    /// Operations for a tile formed alone with `share` of the image's pixels (0 to 1).
    pub fn tile_operations(&self, share: f64) -> f64 {
        self.shared_operations + share * (self.operations - self.shared_operations)
    }

    /// Memory of all buffers, bytes, for one thread forming `share` of the image's pixels (0 to 1).
    pub fn bytes(&self, share: f64) -> u64 {
        let bytes = self.buffers.iter().map(|buffer| match buffer.each {
            Copies::Pixels => (share * buffer.bytes as f64) as u64,
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
    fn single_tile_costs_all_shared_operations() {
        let all = StageCost::shared("tables", 400.2, 1e9);
        let cost = Cost::of([all, StageCost::new("sums", 599.8, 2e9)])
            .holding("tables", Copies::Image, 100.0)
            .holding("sums", Copies::Pixels, 40.0);
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
