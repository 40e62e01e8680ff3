//! A custom image former: the sum of every pixel with phasors by a recurrence over frequency, compared with the
//! exact sum.

use serde_json::{Value, json};
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::focus::cost::Copies;
use subaperture::focus::patch::PatchSize;
use subaperture::focus::{
    Cost, Decision, ErrorGoal, FormError, FormerChoices, Forming, ImageFormer, ImageSpec, Reason,
    StageCost, Tile, Work,
};
use subaperture::image::Comparison;
use subaperture::monitor::{Monitor, during};
use subaperture::num_complex::Complex64;
use subaperture::prelude::*;
use subaperture::simulate::{Preset, Variation};

/// Planned error, dB: float32 rounding is 2^-25 per value, and the float64 recurrence adds less.
const PLANNED_DB: f64 = -110.0;

/// The former, which has no settings.
struct Recurrence;

impl ImageFormer for Recurrence {
    fn name(&self) -> &'static str {
        "recurrence"
    }

    fn settings(&self) -> Value {
        json!({})
    }

    fn bound_db(&self) -> Option<f64> {
        Some(-100.0)
    }

    /// Decide from the specification alone, before any sample is read, how the image is formed and with which error.
    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        if spec.collection.sweeps() {
            return Err(FormError::unsuited(
                "recurrence: expected pulses without intra-pulse motion, which it does not model"
                    .to_owned(),
            ));
        }
        goal.check(PLANNED_DB, || {
            Reason::new("float32 limits the error: raise the bound")
        })?;
        Ok(Decision {
            choices: FormerChoices::default(),
            settings: json!({ "recurrence": "over frequency" }),
            planned_db: PLANNED_DB,
            grain: PatchSize::PIXEL,
            cost: cost(spec),
        })
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        _: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        Ok(Box::new(Opened { spec }))
    }
}

/// Cost: one complex sum and one recurrence step, 16 operations, per pixel, pulse and frequency. One pulse is in memory.
fn cost(spec: &ImageSpec) -> Cost {
    let (pulses, samples) = (spec.collection.pulses.len(), spec.collection.num_samples);
    let all = spec.grid.num_pixels() as f64 * (pulses * samples) as f64;
    // About 4 ns on one core each.
    let sum = StageCost::new("sum", 16.0 * all, 4.0 * all);
    Cost::of([sum]).holding("a pulse", Copies::Pass, 8.0 * samples as f64)
}

struct Opened<'a> {
    spec: ImageSpec<'a>,
}

impl Forming for Opened<'_> {
    /// Form the tiles one pulse at a time, which fits any memory.
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let ImageSpec {
            collection,
            grid,
            weights,
            ..
        } = self.spec;
        let factor = weights.normalisation();
        let mut samples = vec![Complex32::ZERO; collection.num_samples];
        for (n, pulse) in collection.pulses.iter().enumerate() {
            if work.monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
            work.monitor
                .progress(n as f64 / collection.pulses.len() as f64);
            work.history.read(n..n + 1, &mut samples)?;
            let _summing = during(work.monitor, "sum");
            for tile in tiles.iter_mut() {
                let points: Vec<DVec3> = tile.points(grid).collect();
                for (point_m, pixel) in points.into_iter().zip(&mut tile.pixels) {
                    // exp(+j 2 pi f (path - reference path) / c) compensates the phase of an echo from the pixel.
                    let delay_s = pulse.relative_path_m(point_m) / SPEED_OF_LIGHT_M_S;
                    let turned =
                        |hz: f64| Complex64::cis(std::f64::consts::TAU * (hz * delay_s).fract());
                    let (mut phasor, step) = (turned(pulse.start_hz), turned(pulse.step_hz));
                    let mut sum = Complex64::ZERO;
                    for (sample, weight) in samples.iter().zip(&weights.fast) {
                        let sample = Complex64::new(sample.re.into(), sample.im.into());
                        sum += phasor * sample * *weight;
                        phasor *= step;
                    }
                    sum *= factor * weights.slow[n];
                    *pixel += Complex32::new(sum.re as f32, sum.im as f32);
                }
            }
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let recording = Preset::Table41.simulate(&Variation::default());
    let grid: ImageGrid = "x=-4:4:0.5,y=-4:4:0.5,z=0".parse()?;
    let image = Recurrence.focus(&recording, &grid)?;
    let exact = Exact.focus(&recording, &grid)?;
    let found = Comparison::between(&image.image, &exact.image)?;
    println!("predicted error: {:.1} dB", image.predicted_error_db);
    println!(
        "error: {:.1} dB",
        found.error_db.ok_or("an image of zeros")?
    );
    Ok(())
}
