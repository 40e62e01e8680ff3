//! Several channels in one processor: the maps of each are those of a processor with that channel alone.

use subaperture_core::stream::{
    Engine, FixedBuffers, FloatBuffers, MapHeader, Progress, Sample, Setup, SubCpiProcessor,
};
use subaperture_core::{Complex32, Pulse, Sc16};
use subaperture_tests::stream_scene::{Scene, at, patch};

const CHANNELS: usize = 2;
/// Pulses per sub-CPI and channel, frequencies, range bins, Doppler rows.
const M: usize = 4;
const F: usize = 16;
const R: usize = 32;
const ROWS: usize = 7;

/// Header and samples of a map.
type Map = (MapHeader, Vec<Complex32>);

/// Two sub-CPIs of both channels, and a shorter one. Every second pulse is of the second channel.
fn scene() -> Scene {
    let patches = vec![patch([3.0, -2.0, 0.5], 6, 3), patch([-4.0, 5.0, 0.0], 5, 2)];
    let mut scene = Scene::new(M as u16, F as u16, R as u16, 2 * M as u16, 22, patches);
    scene.setup.num_channels = CHANNELS as u16;
    scene
}

/// Maps of these pulses, worked off after each push, and the number of incomplete sub-CPIs.
fn maps<E: Engine<Sample: Sample>>(
    mut processor: SubCpiProcessor<'_, E>,
    scene: &Scene,
    channels: u16,
    pulses: &[(Pulse, &[Complex32])],
    sample: impl Fn(Complex32) -> E::Sample,
) -> (Vec<Map>, u32) {
    let setup = Setup {
        num_channels: channels,
        ..scene.setup
    };
    processor.configure(&setup).unwrap();
    let weights = scene.weights.iter().copied();
    processor.set_weights(0, weights).unwrap();
    for (index, patch) in scene.patches.iter().enumerate() {
        processor.set_patch(index, patch).unwrap();
    }
    processor.start(pulses[0].0.number).unwrap();
    let mut made = Vec::new();
    let mut work = |processor: &mut SubCpiProcessor<'_, E>| {
        loop {
            match processor.work() {
                Progress::Idle => return,
                Progress::Busy => {}
                Progress::Map => {
                    let map = processor.map().unwrap();
                    made.push((map.header, at(&map)));
                }
            }
        }
    };
    for (pulse, samples) in pulses {
        let samples: Vec<E::Sample> = samples.iter().map(|z| sample(*z)).collect();
        // A pulse after a lost one is not stored.
        let _ = processor.push(pulse, samples.iter().copied());
        work(&mut processor);
    }
    processor.finish();
    work(&mut processor);
    (made, processor.counters().incomplete)
}

/// All pulses, or those of one channel, numbered from 0.
fn pulses(scene: &Scene, channel: Option<usize>) -> Vec<(Pulse, &[Complex32])> {
    let all = scene.pulses.iter().zip(&scene.samples).enumerate();
    let chosen = all.filter(|(n, _)| channel.is_none_or(|channel| n % CHANNELS == channel));
    (0..)
        .zip(chosen)
        .map(|(number, (_, (pulse, samples)))| (Pulse { number, ..*pulse }, &samples[..]))
        .collect()
}

fn check<E: Engine<Sample: Sample> + 'static>(
    processor: impl Fn() -> SubCpiProcessor<'static, E>,
    sample: impl Fn(Complex32) -> E::Sample + Copy,
) {
    let scene = scene();
    let (together, incomplete) = maps(
        processor(),
        &scene,
        CHANNELS as u16,
        &pulses(&scene, None),
        sample,
    );
    assert_eq!(incomplete, 0);
    let alone: Vec<Vec<Map>> = (0..CHANNELS)
        .map(|channel| {
            let own = pulses(&scene, Some(channel));
            maps(processor(), &scene, 1, &own, sample).0
        })
        .collect();
    // Three sub-CPIs of two patches, the last one of 3 pulses.
    assert_eq!((together.len(), alone[0].len()), (12, 6));
    for (index, (header, samples)) in together.iter().enumerate() {
        let (channel, map) = (index % CHANNELS, index / CHANNELS);
        let (expected, own) = &alone[channel][map];
        let expected = MapHeader {
            channel: channel as u16,
            ..*expected
        };
        assert_eq!((*header, samples), (expected, own));
    }
    assert_eq!(together[11].0.num_pulses, 3);

    // Without number 9, of the second sub-CPI, that sub-CPI is missing in both channels; the others are the same.
    let mut gap = pulses(&scene, None);
    gap.remove(9);
    let (rest, incomplete) = maps(processor(), &scene, CHANNELS as u16, &gap, sample);
    assert_eq!(incomplete, 1);
    assert_eq!(rest, [&together[..4], &together[8..]].concat());

    // The input ends between the channels of a pulse: the last sub-CPI is incomplete.
    let mut cut = pulses(&scene, None);
    cut.pop();
    let (rest, incomplete) = maps(processor(), &scene, CHANNELS as u16, &cut, sample);
    assert_eq!(incomplete, 1);
    assert_eq!(rest, together[..8]);
}

#[test]
fn float_maps_of_each_channel_equal_those_of_the_channel_alone() {
    check(
        || {
            let buffers = Box::leak(Box::new(
                FloatBuffers::<{ CHANNELS * M }, F, R, ROWS, 2>::new(),
            ));
            buffers.processor()
        },
        |z| z,
    );
}

#[test]
fn fixed_point_maps_of_each_channel_equal_those_of_the_channel_alone() {
    check(
        || {
            let buffers = Box::leak(Box::new(
                FixedBuffers::<{ CHANNELS * M }, F, R, ROWS, 2, 2>::new(),
            ));
            buffers.processor().unwrap()
        },
        |z| Sc16::from_complex32(z).0,
    );
}
