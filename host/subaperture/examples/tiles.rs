//! One image in tiles: planned once, written down, and formed tile by tile, here or on any machine that has the plan and
//! the recording. What comes out is the same to the bit.

use std::error::Error;

use subaperture::focus::plan::{InMemory, Request, Sink};
use subaperture::focus::{BoundPolicy, Plan, SCRATCH_BYTES, Tile, TileRecord, Work};
use subaperture::monitor::Silent;
use subaperture::prelude::*;
use subaperture::simulate::{Preset, Variation};

/// Hands tiles on to an image in memory and says which they were. One of one's own would write files, or send them.
struct Told(InMemory);

impl Sink for Told {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), Box<dyn Error + Send + Sync>> {
        let size = tile.place.size;
        println!("tile {index}: {} x {} pixels", size.columns, size.rows);
        self.0.take(index, tile, record)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let recording = Preset::Table41.simulate(&Variation::default());
    let grid: ImageGrid = "x=-40:40:0.25,y=-40:40:0.25,z=0".parse()?;

    // Once, anywhere: how the image will be formed, as text.
    let request = Request {
        collection: recording.collection(),
        grid: &grid,
        fast: Window::default(),
        slow: Window::default(),
        scratch_bytes: SCRATCH_BYTES,
        bound_policy: BoundPolicy::Refused,
        numerics: Default::default(),
    };
    let text = Plan::new(&RangeDopplerBackprojection::default(), &request, &Silent)?.to_text();

    // Wherever tiles are formed: any of them, in any order, within any memory.
    let plan = Plan::from_text(&text)?;
    let weights = plan.weights(recording.collection())?;
    let opened = plan.open(recording.collection(), &weights)?;
    let work = Work {
        history: &recording,
        memory_bytes: 256 << 20,
        monitor: &Silent,
    };
    let mut image = Told(InMemory::new(&plan.grid));
    for index in (0..plan.num_tiles()).rev() {
        opened.form(&work, &[index], 1, &mut image)?;
    }

    // Where all of them are.
    let records: Vec<TileRecord> = image.0.records.into_values().collect();
    println!(
        "expected error: {:.1} dB",
        opened.judge(&records).predicted_db()
    );
    let whole = RangeDopplerBackprojection::default().focus(&recording, &grid)?;
    let other = (whole.image.pixels.iter())
        .zip(&image.0.image.pixels)
        .filter(|(a, b)| a != b);
    println!("pixels that differ from the whole image: {}", other.count());
    Ok(())
}
