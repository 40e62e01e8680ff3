//! Image chips and detections of the endpoint.
//!
//! Maps are reassembled from the frames and everything else is compared with them. The chip must be bit-identical to the sum
//! that the host forms from the same maps, and agree with the exact sum over pulses and frequencies in float64, which shares no
//! code with it. Detections must be those of the detector run here on the received map, or after clutter cancellation those of the core run here.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture::module::link::Detector;
use subaperture_core::accumulate::{ChipKernel, PixelGrid, add_patch_map};
use subaperture_core::cfar::{Cfar, Column, Detection};
use subaperture_core::dpca::{Dpca, DpcaError};
use subaperture_core::link::{
    CHIP_PART_PIXELS, ChipGrid, Command, Configuration, Encoding, MAX_LIST_BYTES, Refusal, Row,
    State, detection_bytes, write_pixels,
};
use subaperture_core::stream::{FixedBuffers, FloatBuffers, Setup, SubCpiProcessor};
use subaperture_core::{Pulse, Sc16};
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::products::DETECTIONS;
use subaperture_tests::dpca_scene::Run;
use subaperture_tests::stream_scene::{Scene, patch, relative_error_db};

use super::bench::{
    Bench, CHIP, Came, F, Listed, M, PIXELS, R, ROWS, SMALL_CHIP, SPEED_OF_LIGHT_M_S, Target, cfar,
    fixed, float, scene,
};

/// Exact sum at every pixel of `CHIP`.
fn exact_chip(scene: &Scene) -> Vec<Complex64> {
    let distance =
        |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    let mut pixels = Vec::new();
    for row in 0..10 {
        for column in 0..12 {
            let place = [
                1.5 + 0.25 * f64::from(column),
                -3.125 + 0.25 * f64::from(row),
                0.5,
            ];
            let mut sum = Complex64::ZERO;
            for (pulse, samples) in scene.pulses.iter().zip(&scene.samples) {
                let path = distance(pulse.transmitter_m, place) + distance(pulse.receiver_m, place)
                    - pulse.reference_path_m;
                for (k, z) in samples.iter().enumerate() {
                    let f = scene.setup.start_hz + k as f64 * scene.setup.step_hz;
                    let weight = f64::from(scene.weights[k]) * f64::from(pulse.weight);
                    sum += Complex64::new(z.re.into(), z.im.into())
                        * Complex64::cis(TAU * (f * path / SPEED_OF_LIGHT_M_S).fract())
                        * weight;
                }
            }
            let weights: f64 = scene
                .pulses
                .iter()
                .map(|pulse| f64::from(pulse.weight))
                .sum();
            pixels.push(sum / weights);
        }
    }
    pixels
}

/// Sum of the received maps as documented: each times its number of pulses, over the sum of their weights, rounded to the
/// encoding of the module's pixels.
fn chip_of<'m>(
    maps: impl Iterator<Item = &'m Came>,
    setup: &Setup,
    encoding: Encoding,
) -> (u32, f32, Vec<Complex32>) {
    let grid = PixelGrid {
        origin_m: CHIP.origin_m,
        column_step_m: CHIP.column_step_m,
        row_step_m: CHIP.row_step_m,
        num_columns: 12,
        num_rows: 10,
    };
    let kernel = ChipKernel::new();
    let (mut count, mut weights, mut pixels) = (0, 0.0f32, vec![Complex32::ZERO; 120]);
    for map in maps.filter(|map| map.header.patch_index == CHIP.patch) {
        count += 1;
        weights += map.header.weight_sum;
        let pulses = f32::from(map.header.num_pulses);
        let reached =
            add_patch_map(&mut pixels, &grid, setup, &map.view(), &kernel, pulses).unwrap();
        assert_eq!(reached, 120, "the chip lies within the patch");
    }
    let mut bytes = [0; 8 * CHIP_PART_PIXELS];
    let pixels = pixels.chunks(CHIP_PART_PIXELS).flat_map(|part| {
        let bytes = write_pixels(encoding.into(), part, 1.0 / weights, &mut bytes).unwrap();
        let row = Row::new(encoding, part.len(), bytes).unwrap();
        row.values().collect::<Vec<_>>()
    });
    (count, weights, pixels.collect())
}

/// The steps of a chip cover its pixels in order, each once and at its position, in steps of at most 32.
#[test]
fn steps_of_chip_cover_its_pixels_in_order() {
    for (num_columns, num_rows) in [(1, 1), (32, 3), (33, 2), (200, 5), (0, 4), (4, 0)] {
        let chip = ChipGrid {
            num_columns,
            num_rows,
            ..CHIP
        };
        let whole = PixelGrid {
            origin_m: chip.origin_m,
            column_step_m: chip.column_step_m,
            row_step_m: chip.row_step_m,
            num_columns: num_columns.into(),
            num_rows: num_rows.into(),
        };
        let mut next = 0;
        for (pixels, grid) in (0..).map_while(|step| chip.step(step)) {
            assert!((1..=32).contains(&pixels.len()) && pixels.start == next);
            assert_eq!(grid.num_pixels(), Some(pixels.len()));
            for (column, pixel) in pixels.clone().enumerate() {
                let columns = usize::from(num_columns);
                let expected = whole.position_m(pixel / columns, pixel % columns);
                let found = grid.position_m(0, column);
                // Three products and sums of metres below 100: a few units of 1.4e-14 m.
                assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-13));
            }
            next = pixels.end;
        }
        assert_eq!(next, chip.num_pixels());
    }
}

/// Bench with both chips.
fn with_chips<E: WireEngine + 'static>(mut bench: Bench<E>, send_maps: bool) -> Bench<E> {
    bench.send_maps = send_maps;
    bench.configure(&scene());
    bench.set_chips();
    bench
}

fn check_chip<E: WireEngine + 'static>(bench: Bench<E>, most_db: f64) {
    let scene = scene();
    let mut bench = with_chips(bench, true);
    assert_eq!(bench.list(), [0; 2]);
    bench.run(1, &scene);
    assert_eq!(bench.list(), [0b1111, 0]);
    let exact = exact_chip(&scene);
    let both = bench.collect();
    let (grid, maps, weights, pixels) = &both[0];
    assert_eq!((*grid, both[1].0), (CHIP, SMALL_CHIP));
    let expected = chip_of(bench.maps.iter(), &scene.setup, E::MAP_ENCODING);
    assert_eq!((*maps, *weights), (expected.0, expected.1));
    assert_eq!(*maps, 4);
    assert_eq!(*pixels, expected.2);
    let error_db = relative_error_db(pixels, &exact);
    println!("{error_db:.1} dB");
    assert!(error_db <= most_db, "{error_db}");
    // No sub-CPI is added twice.
    bench.run(2, &scene);
    assert_eq!(bench.collect(), both);
    // A new configuration discards the chips.
    bench.configure(&scene);
    bench.run(3, &scene);
    let request = Command::SendChip { patch: 0 };
    assert_eq!(bench.send(&request), Some(Refusal::PatchIndex));
    bench.set_chips();
    bench.run(4, &scene);
    assert_eq!(bench.collect(), both);
}

/// 10 taps are documented with -70.3 dB (`core/src/accumulate/chip.rs`), the curvature of the path included, on a smooth track.
/// This track vibrates by 1 mm, which a line over the sub-CPI cannot follow: for a pixel 1.5 m off centre at 850 m, 2 legs of
/// 0.58 mm RMS times 1.5 / 850 are 1.4 um of 32 mm, 2.9e-4 rad or -71 dB. Both together are -67.6 dB.
#[test]
fn chip_equals_sum_of_received_maps() {
    check_chip(float(), -67.0);
}

/// Rounding of 16-bit maps is -74 dB or better (`core/src/stream/fixed_point/mod.rs`): together -66.7 dB.
#[test]
fn fixed_point_chip_equals_sum_of_received_maps() {
    check_chip(fixed(), -66.0);
}

/// Send the pulses from `first` to `end` as a run. Stopping in the middle of a sub-CPI leaves it incomplete.
fn run_part<E: WireEngine + 'static>(bench: &mut Bench<E>, run: u32, first: u32, end: usize) {
    let scene = scene();
    assert_eq!(bench.send(&Command::Start { run, first }), None);
    let pulses = scene.pulses.iter().zip(&scene.samples);
    for (pulse, samples) in pulses.take(end).skip(first as usize) {
        assert_eq!(bench.push(pulse, samples, E::MAP_ENCODING), None);
    }
    assert_eq!(bench.send(&Command::Stop), None);
    assert_eq!(bench.state(), State::Done);
}

#[test]
fn image_accumulates_over_runs_and_leaves_out_incomplete_sub_cpis() {
    let mut whole = with_chips(float(), false);
    whole.run(1, &scene());
    assert!(whole.maps.is_empty(), "maps were not requested");
    let expected = whole.collect();

    let mut bench = with_chips(float(), false);
    run_part(&mut bench, 1, 0, M);
    assert_eq!(bench.list(), [0b1, 0]);
    // Ends in the third sub-CPI.
    run_part(&mut bench, 2, M as u32, 2 * M + 3);
    assert_eq!(bench.list(), [0b11, 0]);
    assert_eq!(bench.status.unwrap().maps, 2);
    // Begins with a sub-CPI that is already added. The last sub-CPI of the recording is short, and whole.
    run_part(&mut bench, 3, M as u32, 28);
    assert_eq!(bench.list(), [0b1111, 0]);
    assert_eq!(bench.collect(), expected);
}

/// Wherever a run is aborted, the image contains whole sub-CPIs only.
#[test]
fn abort_completes_a_partly_added_sub_cpi() {
    let scene = scene();
    let mut whole = with_chips(float(), false);
    whole.run(1, &scene);
    let expected = whole.collect();
    let mut lists = std::collections::BTreeSet::new();
    for steps in (0..400).step_by(7) {
        let mut bench = with_chips(float(), false);
        assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), None);
        // All but the last pulse of the second sub-CPI, which is then pushed without letting the module work.
        let (last, others) = scene.pulses[..2 * M].split_last().unwrap();
        for (pulse, samples) in others.iter().zip(&scene.samples) {
            bench.push(pulse, samples, Encoding::Complex32);
        }
        bench.deliver_pulse(last, &scene.samples[2 * M - 1]);
        for _ in 0..steps {
            bench.endpoint.work();
        }
        assert_eq!(bench.send(&Command::Abort), None);
        assert_eq!(bench.state(), State::Done);
        let list = bench.list();
        assert!([0b1, 0b11].contains(&list[0]), "{list:?}");
        lists.insert(list);
        run_part(&mut bench, 2, 0, 28);
        assert_eq!(bench.collect(), expected, "{steps} steps");
    }
    assert_eq!(lists.len(), 2, "both outcomes occur");
}

/// Maximum number of detections of one channel per frame.
const MAX_DETECTIONS: usize = MAX_LIST_BYTES / detection_bytes(1);

/// Detection lists reassembled from their frames, one per map.
fn lists(frames: &[Listed], most: usize) -> Vec<(u32, u16, Vec<Target>)> {
    let mut lists: Vec<(u32, u16, Vec<Target>)> = Vec::new();
    for (map, sub_cpi, patch, first, total, list) in frames {
        if *first == 0 {
            assert_eq!(*map as usize, lists.len(), "a list a map, in order");
            lists.push((*sub_cpi, *patch, Vec::new()));
        }
        let (_, _, whole) = lists.last_mut().unwrap();
        assert_eq!(usize::from(*first), whole.len());
        whole.extend(list.iter().cloned());
        let rest = usize::from(*total) - usize::from(*first);
        assert_eq!(list.len(), rest.min(most));
    }
    lists
}

/// Compare detections with the detector run here on the received maps. Returns their number.
fn check_detections<E: WireEngine + 'static>(
    bench: &Bench<E>,
    cfar: &Cfar,
    most: usize,
) -> Vec<usize> {
    let lists = lists(&bench.detections, most);
    assert_eq!(lists.len(), bench.maps.len());
    let mut counts = Vec::new();
    for (map, (sub_cpi, patch, list)) in bench.maps.iter().zip(&lists) {
        assert_eq!(
            (*sub_cpi, *patch),
            (map.header.sub_cpi, map.header.patch_index)
        );
        let mut columns = vec![Column::EMPTY; map.header.patch.num_range_bins()];
        let mut expected = heapless::Vec::<Detection, DETECTIONS>::new();
        cfar.detect_in_map(&map.view(), &mut columns, &mut expected)
            .unwrap();
        let expected = expected.iter().map(|detection| {
            let (doppler_bin, range_bin) = detection.cell();
            (*detection, vec![map.view().at(doppler_bin, range_bin)])
        });
        assert!(list.iter().cloned().eq(expected));
        counts.push(list.len());
    }
    counts
}

/// Two channels: the targets of the first, with the values of both maps.
fn check_channels<E: WireEngine + 'static>(module: impl Fn() -> Bench<E>) {
    const CHANNELS: usize = 2;
    let mut scene = scene();
    scene.setup.num_pulses = (M / CHANNELS) as u16;
    let many = cfar(0.5);
    let alone: Vec<Bench<E>> = (0..CHANNELS)
        .map(|channel| {
            let of_channel = |n: &usize| n % CHANNELS == channel;
            let places = (0..scene.pulses.len()).filter(of_channel);
            let part = Scene {
                setup: scene.setup,
                weights: scene.weights.clone(),
                patches: scene.patches.clone(),
                pulses: (0..)
                    .zip(places.clone())
                    .map(|(number, n)| Pulse {
                        number,
                        ..scene.pulses[n]
                    })
                    .collect(),
                samples: places.map(|n| scene.samples[n].clone()).collect(),
            };
            let mut bench = module();
            bench.configure(&part);
            assert_eq!(bench.send(&Command::Detect(many)), None);
            bench.run(1, &part);
            bench
        })
        .collect();

    scene.setup.num_channels = CHANNELS as u16;
    let mut both = module();
    both.send_maps = false;
    both.configure(&scene);
    assert_eq!(both.send(&Command::Detect(many)), None);
    both.run(1, &scene);
    let most = MAX_LIST_BYTES / detection_bytes(CHANNELS);
    let (together, expected) = (
        lists(&both.detections, most),
        lists(&alone[0].detections, MAX_DETECTIONS),
    );
    assert_eq!(together.len(), 8, "3.5 sub-CPIs, two patches");
    assert_eq!(together.len(), expected.len());
    for (map, ((sub_cpi, patch, list), first)) in together.iter().zip(&expected).enumerate() {
        assert_eq!(
            (sub_cpi, patch, list.len()),
            (&first.0, &first.1, first.2.len())
        );
        for ((target, values), (alone_in_first, _)) in list.iter().zip(&first.2) {
            assert_eq!(target, alone_in_first);
            let (doppler_bin, range_bin) = target.cell();
            let own = alone
                .iter()
                .map(|bench| bench.maps[map].view().at(doppler_bin, range_bin));
            assert_eq!(*values, own.collect::<Vec<_>>());
            assert_ne!(values[0], values[1]);
        }
    }

    // Maps and images are of one channel, and no more than four channels are detected.
    let chip = both.send(&Command::Chip(CHIP));
    let refused = |wanted, most| Some(Refusal::Channels { wanted, most });
    assert_eq!(chip, refused(2, 1));
    let mut configure = |num_channels, send_maps| {
        both.send(&Command::Configure(Configuration {
            id: 6,
            setup: Setup {
                num_pulses: 1,
                num_channels,
                ..scene.setup
            },
            total_pulses: 28,
            send_maps,
        }))
    };
    assert_eq!(configure(2, true), refused(2, 1));
    assert_eq!(configure(5, false), refused(5, 4));
    assert_eq!(configure(4, false), None);
}

#[test]
fn detections_have_the_values_of_every_channel() {
    check_channels(float);
    check_channels(fixed);
}

/// Detections on the difference of two channels are those of the core run here, bit by bit, with the aligned values.
fn check_cancellation<E: WireEngine + 'static>(
    mut bench: Bench<E>,
    processor: SubCpiProcessor<'_, E>,
    narrow: impl Fn(&Complex32) -> E::Sample,
) {
    let mut scene = scene();
    scene.setup.num_pulses = (M / 2) as u16;
    scene.setup.num_channels = 2;
    // Kept maps of at most 128 values, the pixels of the bench.
    scene.patches = vec![patch([3.0, -2.0, 0.5], 3, 7), patch([-4.0, 6.0, 0.0], 4, 5)];
    let detector = Detector {
        cfar: cfar(0.5),
        dpca: Some(Dpca { lag_pulses: -0.5 }),
    };
    let (detect, cancel) = (
        Command::Detect(detector.cfar),
        Command::Dpca(detector.dpca.unwrap()),
    );
    bench.send_maps = false;
    bench.configure(&scene);
    assert_eq!(bench.send(&cancel), None);
    assert_eq!(bench.send(&detect), None);
    bench.run(1, &scene);
    let received = bench.detections.clone();
    let lists = lists(&received, MAX_LIST_BYTES / detection_bytes(2));
    let samples: Vec<Vec<E::Sample>> = (scene.samples.iter())
        .map(|samples| samples.iter().map(&narrow).collect())
        .collect();
    let run = Run {
        setup: &scene.setup,
        weights: &scene.weights,
        patches: &scene.patches,
        detector: &detector,
    };
    let pulses = scene.pulses.iter().zip(&samples);
    let expected = run.expected(
        processor,
        pulses.map(|(pulse, samples)| (pulse, samples.iter().copied())),
    );
    assert_eq!(
        (lists.len(), expected.len()),
        (8, 8),
        "3.5 sub-CPIs, two patches"
    );
    for (sub_cpi, patch, list) in &lists {
        let own = &expected[&(*sub_cpi, *patch)];
        let own = own.iter().map(|one| (one.detection, one.values.clone()));
        assert!(list.iter().cloned().eq(own));
        assert!(list.len() > 2, "{}", list.len());
    }
    assert!(
        lists.iter().any(|(_, _, list)| list.len() > 5),
        "of several frames"
    );
    // Settings last until the next configuration; without the cancellation the lists are others.
    bench.run(2, &scene);
    assert_eq!(bench.detections, received);
    bench.configure(&scene);
    assert_eq!(bench.send(&detect), None);
    bench.run(3, &scene);
    assert_ne!(bench.detections, received);

    // A map that does not fit is refused at the start, whatever the order of the commands.
    scene.patches = vec![patch([3.0, -2.0, 0.5], 4, 7)];
    bench.configure(&scene);
    assert_eq!(bench.send(&cancel), None);
    let too_large = DpcaError::Map {
        wanted: 9 * 16,
        most: PIXELS as u32,
    };
    let start = Command::Start { run: 4, first: 0 };
    assert_eq!(bench.send(&start), Some(Refusal::Dpca(too_large)));
    for (lag_pulses, error) in [
        (0.0, DpcaError::NoLag),
        (f64::NAN, DpcaError::NotFinite),
        (f64::NEG_INFINITY, DpcaError::NotFinite),
        (2.5, DpcaError::LagTooLong { found: 3, most: 2 }),
        (
            -1e300,
            DpcaError::LagTooLong {
                found: u32::MAX,
                most: 2,
            },
        ),
    ] {
        let refused = bench.send(&Command::Dpca(Dpca { lag_pulses }));
        assert_eq!(refused, Some(Refusal::Dpca(error)));
    }
    scene.setup.num_channels = 1;
    bench.configure(&scene);
    let one = Refusal::Dpca(DpcaError::Channels { found: 1 });
    assert_eq!(bench.send(&cancel), Some(one));
    assert!(one.to_string().contains("expected 2, found 1"), "{one}");
}

#[test]
fn detections_after_cancellation_equal_those_of_the_core() {
    let buffers = Box::leak(Box::new(FloatBuffers::<M, F, R, ROWS, 3>::new()));
    check_cancellation(float(), buffers.processor(), |z| *z);
    let buffers = Box::leak(Box::new(FixedBuffers::<M, F, R, ROWS, 2, 3>::new()));
    let processor = buffers.processor().unwrap();
    check_cancellation(fixed(), processor, |z| Sc16::from_complex32(*z).0);
}

fn check_lists<E: WireEngine + 'static>(mut bench: Bench<E>) {
    let scene = scene();
    bench.configure(&scene);
    // So many false alarms that lists are full and take several frames.
    let many = cfar(0.5);
    assert_eq!(bench.send(&Command::Detect(many)), None);
    bench.run(1, &scene);
    let counts = check_detections(&bench, &many, MAX_DETECTIONS);
    println!("{counts:?}");
    assert!(counts.iter().all(|count| *count > MAX_DETECTIONS));
    // The last settings apply. An empty list takes one frame per map.
    let none = cfar(1e-300);
    assert_eq!(bench.send(&Command::Detect(none)), None);
    bench.run(2, &scene);
    assert_eq!(bench.detections.len(), bench.maps.len());
    let counts = check_detections(&bench, &none, MAX_DETECTIONS);
    assert!(counts.iter().all(|count| *count == 0), "{counts:?}");
    // Detections and a chip together.
    assert_eq!(bench.send(&Command::Detect(many)), None);
    bench.set_chips();
    bench.run(3, &scene);
    check_detections(&bench, &many, MAX_DETECTIONS);
    let expected = chip_of(bench.maps.iter(), &scene.setup, E::MAP_ENCODING).2;
    assert_eq!(bench.collect()[0].3, expected);
    // Without maps the detections are the same.
    let with_maps = bench.detections.clone();
    bench.send_maps = false;
    bench.configure(&scene);
    assert_eq!(bench.send(&Command::Detect(many)), None);
    bench.run(4, &scene);
    assert!(bench.maps.is_empty());
    assert_eq!(bench.detections, with_maps);
}

#[test]
fn detections_match_received_maps() {
    check_lists(float());
}

#[test]
fn fixed_point_detections_match_received_maps() {
    check_lists(fixed());
}

/// A module whose row buffer of 128 bytes holds 5 detections sends 5 per frame.
#[test]
fn short_row_buffer_sends_fewer_detections_per_frame() {
    let buffers = Box::leak(Box::new(FloatBuffers::<M, 16, 32, ROWS, 1>::new()));
    let mut bench = Bench::with_row(buffers.processor(), 16, 16);
    let patches = vec![patch([1.0, 1.0, 0.0], 7, 7)];
    let scene = Scene::new(M as u16, 16, 32, 16, 2 * M, patches);
    bench.configure(&scene);
    let many = cfar(0.5);
    assert_eq!(bench.send(&Command::Detect(many)), None);
    bench.run(1, &scene);
    let counts = check_detections(&bench, &many, 5);
    assert!(counts.iter().all(|count| *count > 5), "{counts:?}");
}

/// The strongest detection is the point, within a tenth of a bin of the position from its path.
fn check_point<E: WireEngine + 'static>(mut bench: Bench<E>) {
    let place = [5.0, -3.0, 0.0];
    let wide = patch([2.0, -1.0, 0.0], 15, 7);
    let mut scene = Scene::point(M as u16, F as u16, R as u16, 2 * M as u16, wide, place);
    for sample in scene.samples.iter_mut().flatten() {
        *sample *= 0.5;
    }
    bench.configure(&scene);
    let settings = cfar(1e-3);
    assert_eq!(bench.send(&Command::Detect(settings)), None);
    bench.run(1, &scene);
    check_detections(&bench, &settings, MAX_DETECTIONS);
    let (a, b) = scene.line(place, 0);
    let setup = &scene.setup;
    let range_bin = a * R as f64 * setup.step_hz / SPEED_OF_LIGHT_M_S;
    let doppler_bin = -b * 2.0 * M as f64 * setup.centre_hz() / SPEED_OF_LIGHT_M_S;
    let strongest = bench.detections[0].5[0].0;
    println!("{strongest:?} for {range_bin:.2} {doppler_bin:.2}");
    assert!((f64::from(strongest.range_bin) - range_bin).abs() < 0.1);
    assert!((f64::from(strongest.doppler_bin) - doppler_bin).abs() < 0.1);
    // The parabola goes through logarithms. For sinc^2 sampled twice per resolution cell it is exact on a bin. Half a bin off,
    // where the cells are ln 0.8106 twice and ln 0.0901, its vertex is at exp(0.0647) in
    // either axis.
    let gain = strongest.power / 0.25;
    assert!(gain > 0.99 && gain < 1.067f32.powi(2) * 1.01, "{gain}");
}

#[test]
fn strong_point_is_detected_at_its_position() {
    check_point(float());
    check_point(fixed());
}
