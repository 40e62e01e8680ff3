//! A job of two channels for a module that cancels clutter, and its expected detections, bit by bit.

use std::collections::BTreeMap;

use heapless::Vec as List;
use num_complex::Complex32;
use subaperture::module::detections::lag_pulses;
use subaperture::module::link::{ChannelDetection, Detector, Job, PulseSource};
use subaperture::phase_history::{InMemory, PhaseHistory};
use subaperture_core::Pulse;
use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
use subaperture_core::dpca::{Balance, Difference, Dpca};
use subaperture_core::link::{Encoding, complex32s, sc16s};
use subaperture_core::stream::{
    Engine, FixedBuffers, FloatBuffers, Patch, Progress, Sample, Setup, SubCpiProcessor,
};

use crate::link_scene::{Key, recorded, scene};
use crate::stream_scene::Scene;

/// Detections by sub-CPI and patch.
pub type Found = BTreeMap<Key, Vec<ChannelDetection>>;

/// Recordings of both channels: the pulses of [`scene`] in turn. Both move two steps of the scene's track from pulse to pulse, and the second
/// is one step ahead.
pub fn recordings() -> [InMemory; 2] {
    [0, 1].map(|channel| {
        let Scene {
            setup,
            weights,
            patches,
            pulses,
            samples,
        } = scene();
        let of_channel = |n: usize| n % 2 == channel;
        let places = (0..pulses.len()).filter(|n| of_channel(*n));
        recorded(&Scene {
            setup,
            weights,
            patches,
            pulses: places.clone().map(|n| pulses[n]).collect(),
            samples: places.map(|n| samples[n].clone()).collect(),
        })
    })
}

/// Detector for the recordings: so many false alarms that lists take several frames.
///
/// # Panics
/// If the lag is not half a pulse: the positions have a jitter of 1 mm in 0.7 m.
pub fn detector([first, second]: &[InMemory; 2]) -> Detector {
    let lag_pulses = lag_pulses(&[first.collection(), second.collection()]).unwrap();
    assert!((lag_pulses + 0.5).abs() < 2e-3, "{lag_pulses}");
    let window = TrainingWindow {
        guard: 1,
        training: 2,
    };
    Detector {
        cfar: Cfar {
            range: window,
            doppler: window,
            false_alarm_probability: 0.5,
        },
        dpca: Some(Dpca { lag_pulses }),
    }
}

/// The job on the recordings.
pub fn job<'a>(
    [first, second]: &'a [InMemory; 2],
    detector: &Detector,
    encoding: Encoding,
) -> Job<'a> {
    let scene = scene();
    let setup = Setup {
        num_channels: 2,
        ..scene.setup
    };
    let weights = vec![1.0; first.collection().pulses.len()];
    let pulses = PulseSource::new(&[first, second], &weights, encoding).unwrap();
    Job {
        setup,
        fast_weights: scene.weights,
        patches: scene.patches,
        pulses: match &detector.dpca {
            Some(dpca) => pulses.displaced(dpca, setup.num_pulses),
            None => pulses,
        },
    }
}

/// Detections on a job by the core on this machine.
///
/// # Panics
/// If a setting or a pulse is refused.
pub fn expected_of(job: &mut Job<'_>, detector: &Detector) -> Found {
    let count = job.pulses.len();
    let owned = |n: u32| {
        let (pulse, bytes) = job.pulses.pulse(n).unwrap();
        (pulse, bytes.to_vec())
    };
    let pulses: Vec<(Pulse, Vec<u8>)> = (0..count).map(owned).collect();
    let run = Run {
        setup: &job.setup,
        weights: &job.fast_weights,
        patches: &job.patches,
        detector,
    };
    match job.pulses.encoding() {
        Encoding::Complex32 => {
            let mut buffers = Box::new(FloatBuffers::<8, 40, 128, 24, 4>::new());
            let pulses = pulses
                .iter()
                .map(|(pulse, bytes)| (pulse, complex32s(bytes)));
            run.expected(buffers.processor(), pulses)
        }
        Encoding::Sc16 => {
            let mut buffers = Box::new(FixedBuffers::<8, 40, 128, 24, 3, 4>::new());
            let pulses = pulses.iter().map(|(pulse, bytes)| (pulse, sc16s(bytes)));
            run.expected(buffers.processor().unwrap(), pulses)
        }
    }
}

/// Settings of a run with cancellation.
pub struct Run<'r> {
    /// Settings of the maps.
    pub setup: &'r Setup,
    /// Fast-time weights.
    pub weights: &'r [f32],
    /// Patches of the scene.
    pub patches: &'r [Patch],
    /// Detector with a cancellation.
    pub detector: &'r Detector,
}

impl Run<'_> {
    /// Detections by the core on this machine.
    ///
    /// # Panics
    /// If a setting or a pulse is refused.
    pub fn expected<'p, E: Engine<Sample: Sample>, S>(
        &self,
        mut processor: SubCpiProcessor<'_, E>,
        pulses: impl Iterator<Item = (&'p Pulse, S)>,
    ) -> Found
    where
        S: ExactSizeIterator<Item = E::Sample> + Clone,
    {
        let dpca = self.detector.dpca.unwrap();
        processor.configure(self.setup).unwrap();
        processor
            .set_weights(0, self.weights.iter().copied())
            .unwrap();
        for (index, patch) in self.patches.iter().enumerate() {
            processor.set_patch(index, patch).unwrap();
        }
        processor.start(0).unwrap();
        let (mut kept, mut found) = (Vec::new(), Found::new());
        let mut work = |processor: &mut SubCpiProcessor<'_, E>| {
            loop {
                match processor.work() {
                    Progress::Idle => return,
                    Progress::Busy => {}
                    Progress::Map => {
                        let map = processor.map().unwrap();
                        let header = map.header;
                        if header.channel == 0 {
                            kept = vec![Complex32::ZERO; Dpca::kept_len(&header.patch)];
                            let rows = (0..)
                                .take_while(|row| dpca.keep_row(self.setup, &map, *row, &mut kept));
                            assert_eq!(rows.count(), header.patch.num_doppler_bins());
                            continue;
                        }
                        let mut balance = Balance::new();
                        while balance.step(&map, &mut kept) {}
                        let difference = Difference {
                            dpca: &dpca,
                            setup: self.setup,
                            map: &map,
                            kept: &kept,
                            gain: balance.gain(),
                        };
                        let [_, bins] = difference.shape();
                        let (mut columns, mut list) =
                            (vec![Column::EMPTY; bins], List::<Detection, 32>::new());
                        let mut search = self.detector.cfar.begin().unwrap();
                        let power = |row, column| difference.power(row, column);
                        while search
                            .step_in_cells(difference.shape(), power, &mut columns, &mut list)
                            .unwrap()
                        {}
                        let with_values = list.iter().map(|detection| ChannelDetection {
                            detection: *detection,
                            values: difference.values(detection.cell()).to_vec(),
                        });
                        let key = (header.sub_cpi, header.patch_index);
                        found.insert(key, with_values.collect());
                    }
                }
            }
        };
        for (pulse, samples) in pulses {
            processor.push(pulse, samples).unwrap();
            work(&mut processor);
        }
        processor.finish();
        work(&mut processor);
        found
    }
}
