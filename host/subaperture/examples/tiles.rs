//! Image formed tile by tile by a plan that can be stored as text. The result is bit-identical to an image formed at once.

use std::error::Error;

use subaperture::focus::plan::{ImageSink, InMemory, Sink};
use subaperture::focus::{BoundPolicy, Execution, ImageSpec, Plan, Tile, TileRecord, Work};
use subaperture::monitor::Silent;
use subaperture::phase_history::Weights;
use subaperture::prelude::*;
use subaperture::simulate::{Preset, Variation};

/// Image in memory that prints its tiles. Another sink writes files, or sends the tiles to another machine.
struct Printed(InMemory);

impl Sink for Printed {
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

impl ImageSink for Printed {
    fn begin(&mut self, plan: &Plan) -> Result<Vec<usize>, Box<dyn Error + Send + Sync>> {
        println!("planned error: {:.1} dB", plan.planned_db);
        // A sink that continues an earlier run returns the tiles that are missing.
        self.0.begin(plan)
    }

    fn records(&mut self) -> Result<Option<Vec<TileRecord>>, Box<dyn Error + Send + Sync>> {
        self.0.records()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let recording = Preset::Table41.simulate(&Variation::default());
    let grid: ImageGrid = "x=-40:40:0.25,y=-40:40:0.25,z=0".parse()?;
    let former = RangeDopplerBackprojection::default();
    let window = Window::default();

    // Plan once, on any machine, from the geometry alone. The text states everything except the samples.
    let weights = Weights::new(recording.collection(), window, window);
    let spec = ImageSpec::new(recording.collection(), &grid, &weights);
    let text = Plan::new(&former, &spec, BoundPolicy::Refused, &Silent)?.to_text();

    // Execute the plan where the recording is: form the tiles, compare them with the exact sum, and replan if the scene requires it.
    let plan = Plan::from_text(&text)?;
    let weights = plan.weights(recording.collection())?;
    let execution = Execution {
        former: &former,
        spec: plan.spec(recording.collection(), &weights),
        work: Work {
            history: &recording,
            memory_bytes: 256 << 20,
            monitor: &Silent,
        },
        may_replan: true,
    };
    let mut image = Printed(InMemory::new());
    let executed = execution.run(&plan, &mut image)?.expect("all tiles");
    println!(
        "predicted error: {:.1} dB",
        executed.judgement.predicted_db()
    );

    let whole = former.focus(&recording, &grid)?;
    let other = (whole.image.pixels.iter())
        .zip(&image.0.image.pixels)
        .filter(|(a, b)| a != b);
    println!("pixels that differ from the whole image: {}", other.count());
    Ok(())
}
