//! A job of a second for a module, and its expected maps, bit by bit.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use num_complex::Complex32;
use subaperture::geometry::SceneFrame;
use subaperture::module::link::{
    AccumulatedImage, ImageRequest, ImageSum, Job, MapSink, PulseSource, SinkError,
};
use subaperture::phase_history::{Collection, InMemory, Pulse, Sweep};
use subaperture_core::accumulate::{ChipKernel, add_patch_map};
use subaperture_core::link::{AssembledMap, ChipGrid, Encoding};
use subaperture_core::stream::{FloatBuffers, MapHeader, MapSamples, PatchMap, Progress};

use crate::stream_scene::{Scene, at, patch};

/// Pulses: eleven sub-CPIs of 4 and one of 2.
pub const PULSES: usize = 46;
/// Maps, of two patches.
pub const MAPS: usize = 24;

/// Scene of a job for an image: its patches have room for the chips' interpolation kernel.
pub fn image_scene() -> Scene {
    let patches = vec![
        patch([3.0, -2.0, 0.5], 12, 7),
        patch([-4.0, 6.0, 0.0], 11, 7),
    ];
    Scene::new(4, 16, 32, 16, PULSES, patches)
}

/// Chips of 6 by 5 and 4 by 3 pixels around the patch centres of [`image_scene`].
pub const CHIPS: [ChipGrid; 2] = [
    ChipGrid {
        patch: 0,
        origin_m: [2.75, -2.25, 0.5],
        column_step_m: [0.125, 0.0, 0.0],
        row_step_m: [0.0, 0.125, 0.0],
        num_columns: 6,
        num_rows: 5,
    },
    ChipGrid {
        patch: 1,
        origin_m: [-4.25, 6.0, 0.0],
        column_step_m: [0.125, 0.0, 0.0],
        row_step_m: [0.0, 0.125, 0.0],
        num_columns: 4,
        num_rows: 3,
    },
];

/// The complex image of [`CHIPS`].
pub const COHERENT: ImageRequest<'static> = ImageRequest {
    chips: &CHIPS,
    sum: ImageSum::Coherent,
    previews: 0,
};

/// The mean power of the sub-CPIs on [`CHIPS`].
pub const POWER: ImageRequest<'static> = ImageRequest {
    sum: ImageSum::Power,
    previews: 0,
    ..COHERENT
};

/// Assert that an image is bit-identical to the sum, over the sub-CPIs that it lists, of the maps of the core on this machine.
///
/// # Panics
/// If it differs, or a sub-CPI is listed twice.
#[track_caller]
pub fn judge_image(image: &AccumulatedImage) {
    let scene = image_scene();
    let maps = expected(&scene);
    let kernel = ChipKernel::new();
    let once: BTreeSet<u32> = image.sub_cpis.iter().copied().collect();
    assert_eq!(once.len(), image.sub_cpis.len(), "{:?}", image.sub_cpis);
    assert_eq!(image.left_out, 0);
    for (grid, chip) in CHIPS.iter().zip(&image.chips) {
        let Some(chip) = chip else { continue };
        let mut pixels = vec![Complex32::ZERO; chip.len()];
        let mut weight_sum = 0.0;
        for &sub_cpi in &image.sub_cpis {
            let (header, values) = &maps[&(sub_cpi, grid.patch)];
            let map = PatchMap {
                header: *header,
                samples: MapSamples::Float(values),
            };
            let weight = f32::from(header.num_pulses);
            for (range, part) in (0..).map_while(|step| grid.step(step)) {
                let pixels = &mut pixels[range];
                add_patch_map(pixels, &part, &scene.setup, &map, &kernel, weight).unwrap();
            }
            weight_sum += header.weight_sum;
        }
        assert_eq!(image.weight_sum.to_bits(), f32::to_bits(weight_sum));
        let scale = 1.0 / weight_sum;
        let pixels: Vec<Complex32> = pixels
            .iter()
            .map(|z| Complex32::new(z.re * scale, z.im * scale))
            .collect();
        assert_eq!(bits(chip), bits(&pixels), "chip of patch {}", grid.patch);
    }
}

/// Scene of the job.
pub fn scene() -> Scene {
    let patches = vec![patch([3.0, -2.0, 0.5], 8, 3), patch([-4.0, 6.0, 0.0], 6, 2)];
    Scene::new(4, 16, 32, 16, PULSES, patches)
}

/// The scene's pulses as a recording.
pub fn recorded(scene: &Scene) -> InMemory {
    let pulses = scene.pulses.iter().map(|pulse| Pulse {
        time_s: pulse.time_s,
        transmitter_m: DVec3::from(pulse.transmitter_m),
        receiver_m: DVec3::from(pulse.receiver_m),
        reference_m: DVec3::ZERO,
        reference_path_m: pulse.reference_path_m,
        start_hz: scene.setup.start_hz,
        step_hz: scene.setup.step_hz,
        sweep: Sweep::AT_ONCE,
        recorded_path_m: None,
    });
    let collection = Collection {
        name: "scene".to_owned(),
        num_samples: scene.setup.num_frequencies.into(),
        pulses: pulses.collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    InMemory::new(collection, scene.samples.concat()).unwrap()
}

/// The job on a recording of the scene.
pub fn job<'a>(scene: &Scene, recording: &'a InMemory, encoding: Encoding) -> Job<'a> {
    let weights: Vec<f64> = scene
        .pulses
        .iter()
        .map(|pulse| pulse.weight.into())
        .collect();
    Job {
        setup: scene.setup,
        fast_weights: scene.weights.clone(),
        patches: scene.patches.clone(),
        pulses: PulseSource::new(&[recording], &weights, encoding).unwrap(),
    }
}

/// Sub-CPI and patch.
pub type Key = (u32, u16);
/// Headers and samples of maps.
pub type Kept = BTreeMap<Key, (MapHeader, Vec<Complex32>)>;

/// Expected maps, by the core on this machine.
pub fn expected(scene: &Scene) -> Kept {
    let mut buffers = Box::new(FloatBuffers::<8, 40, 128, 24, 4>::new());
    let mut processor = buffers.processor();
    processor.configure(&scene.setup).unwrap();
    processor
        .set_weights(0, scene.weights.iter().copied())
        .unwrap();
    for (index, patch) in scene.patches.iter().enumerate() {
        processor.set_patch(index, patch).unwrap();
    }
    processor.start(0).unwrap();
    let mut maps = Kept::new();
    for n in 0..=scene.pulses.len() {
        match scene.pulses.get(n) {
            Some(pulse) => processor
                .push(pulse, scene.samples[n].iter().copied())
                .unwrap(),
            None => processor.finish(),
        }
        loop {
            match processor.work() {
                Progress::Idle => break,
                Progress::Busy => {}
                Progress::Map => {
                    let map = processor.map().unwrap();
                    let key = (map.header.sub_cpi, map.header.patch_index);
                    maps.insert(key, (map.header, at(&map)));
                }
            }
        }
    }
    assert_eq!(maps.len(), MAPS);
    maps
}

/// Sink that keeps the received maps.
#[derive(Default)]
pub struct Keep(pub Kept);

impl MapSink for Keep {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        let key = (map.header.sub_cpi, map.header.patch_index);
        let values = map
            .rows()
            .flat_map(|row| row.values().collect::<Vec<_>>())
            .collect();
        assert!(
            self.0.insert(key, (map.header, values)).is_none(),
            "{key:?} twice"
        );
        Ok(())
    }
}

/// The bits of samples.
pub fn bits(values: &[Complex32]) -> Vec<(u32, u32)> {
    values
        .iter()
        .map(|z| (z.re.to_bits(), z.im.to_bits()))
        .collect()
}

/// Assert that maps equal those of the core.
///
/// # Panics
/// If one differs.
#[track_caller]
pub fn judge(kept: &Kept) {
    let expected = expected(&scene());
    for (key, (header, values)) in kept {
        let (expected_header, expected_values) = &expected[key];
        assert_eq!(header, expected_header);
        assert_eq!(bits(values), bits(expected_values), "map {key:?}");
    }
}
