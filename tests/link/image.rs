//! Images that a module accumulates, over lossy lines: no wrong pixel is ever accepted, no sub-CPI is added twice, and missing
//! sub-CPIs are listed.
//!
//! The module is the firmware's own endpoint in a thread of this process. Images are compared bit by bit with the sum of the
//! maps of the core run here.

use std::time::Duration;

use subaperture::module::accumulated::by_host_core;
use subaperture::module::detections::lag_pulses;
use subaperture::module::link::{
    AccumulatedImage, Buffers, ChannelDetection, Counts, DetectionSink, Detector, HostCore,
    ImageRequest, LinkError, Outcome, Session, SessionObserver, Settings, SinkError, TransferEnd,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
use subaperture_core::dpca::DpcaError;
use subaperture_core::link::Encoding;
use subaperture_core::stream::{MapSamples, PatchMap};
use subaperture_tests::dpca_scene;
use subaperture_tests::faults::Faults;
use subaperture_tests::link_scene::{
    CHIPS, COHERENT, Key, MAPS, POWER, PULSES, expected, image_scene, job, judge_image, recorded,
};
use subaperture_tests::module::{Manner, Module};

fn settings(retries: u32) -> Settings {
    Settings {
        answer: Duration::from_millis(30),
        idle: Duration::from_secs(5),
        retries,
        first_number: 77,
        ..Settings::default()
    }
}

fn image(faults: Faults, settings: Settings) -> (Outcome, AccumulatedImage) {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let mut module = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let (outcome, image) = session.accumulate(&mut job, COHERENT, &mut Silent);
    println!("{}", outcome.counts);
    judge_image(&image);
    let counts = &outcome.counts;
    assert_eq!(counts.maps_taken, 2 * image.sub_cpis.len() as u64);
    assert_eq!(outcome.missing.len() + 2 * image.sub_cpis.len(), MAPS);
    (outcome, image)
}

/// Assert that an image has all sub-CPIs and pixels.
#[track_caller]
fn complete(faults: Faults, settings: Settings) -> (Outcome, AccumulatedImage) {
    let (outcome, image) = image(faults, settings);
    assert!(
        matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
    assert_eq!(image.sub_cpis.len(), MAPS / 2);
    assert!(image.chips.iter().all(Option::is_some));
    (outcome, image)
}

#[test]
fn clean_line_delivers_the_image_in_one_run() {
    let (outcome, image) = complete(Faults::default(), settings(3));
    let counts = &outcome.counts;
    assert_eq!((counts.runs, counts.pulses_sent), (1, PULSES as u64));
    assert!(image.sub_cpis.is_sorted());
    // 42 pixels of 8 bytes, where the maps have 24 times some 300 samples.
    assert!(counts.bytes_from_module < 3000, "{counts}");
}

#[test]
fn bit_errors_only_cost_time() {
    for (seed, bit_errors) in [(1, 1e-5), (2, 1e-4), (3, 2e-4)] {
        let faults = Faults {
            seed,
            bit_errors,
            ..Faults::default()
        };
        let (outcome, _) = complete(faults, settings(1000));
        if bit_errors > 5e-5 {
            assert!(outcome.counts.maps_fetched_again > 0);
        }
    }
}

#[test]
fn line_with_an_error_in_a_thousand_bits_gives_no_wrong_pixel() {
    for seed in 4..6 {
        let faults = Faults {
            seed,
            bit_errors: 1e-3,
            ..Faults::default()
        };
        // A pulse of some 200 bytes arrives with a probability of 0.2, all four of a sub-CPI with 0.0016.
        let (outcome, image) = image(faults, settings(3));
        println!("{:?} {:?}", outcome.ending, image.sub_cpis);
        assert!(outcome.counts.frames_from_module.damaged > 0);
        assert_eq!(
            matches!(outcome.ending, TransferEnd::Complete),
            outcome.missing.is_empty() && image.chips.iter().all(Option::is_some)
        );
    }
}

#[test]
fn sub_cpis_missing_without_retries_are_listed() {
    let faults = Faults {
        seed: 5,
        dropped_pulses: 0.05,
        ..Faults::default()
    };
    let (outcome, image) = image(faults, settings(0));
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    assert!(!image.sub_cpis.is_empty() && !outcome.missing.is_empty());
    assert!(image.chips.iter().all(Option::is_some));
}

#[test]
fn image_survives_failures_of_the_line() {
    let faults = Faults {
        dies_at: vec![5_000, 8_111],
        ..Faults::default()
    };
    let (outcome, _) = complete(faults, settings(3));
    let counts = &outcome.counts;
    assert_eq!((counts.reconnects, counts.restarts), (2, 0));
    // The module was not configured again, and only cut sub-CPIs were repeated.
    assert!(counts.pulses_sent < PULSES as u64 + 3 * 8, "{counts}");
}

/// Observer that keeps the previews, and cancels after so many.
#[derive(Default)]
struct Previews {
    images: Vec<AccumulatedImage>,
    most: Option<usize>,
}

impl SessionObserver for Previews {
    fn preview(&mut self, image: &AccumulatedImage) {
        self.images.push(image.clone());
    }

    fn cancelled(&self) -> bool {
        self.most.is_some_and(|most| self.images.len() >= most)
    }
}

/// Image with two previews; both previews and image were compared with the core.
fn previewed(faults: Faults, most: Option<usize>) -> (Outcome, Vec<AccumulatedImage>) {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut module = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let mut session =
        Session::open(&mut module, &mut buffers, settings(1000), &mut Silent).unwrap();
    let request = ImageRequest {
        previews: 2,
        ..COHERENT
    };
    let mut previews = Previews {
        images: Vec::new(),
        most,
    };
    let mut work = job(&scene, &recording, Encoding::Complex32);
    let (outcome, image) = session.accumulate(&mut work, request, &mut previews);
    println!("{}", outcome.counts);
    let mut images = previews.images;
    images.push(image);
    for image in &images {
        assert!(image.chips.iter().all(Option::is_some));
        judge_image(image);
        let mut core = HostCore::new(job(&scene, &recording, Encoding::Complex32)).unwrap();
        let expected = by_host_core(&mut core, COHERENT, &image.sub_cpis).unwrap();
        assert_eq!(*image, expected);
    }
    (outcome, images)
}

#[test]
fn previews_are_images_of_the_sub_cpis_so_far() {
    let (outcome, images) = previewed(Faults::default(), None);
    assert!(matches!(outcome.ending, TransferEnd::Complete));
    let counts = &outcome.counts;
    assert_eq!((counts.runs, counts.pulses_sent), (3, PULSES as u64));
    let sub_cpis: Vec<usize> = images.iter().map(|image| image.sub_cpis.len()).collect();
    assert_eq!(sub_cpis, [4, 8, 12]);
    assert_eq!(sub_cpis[2], MAPS / 2);
    // Without previews one run is enough.
    let (outcome, _) = complete(Faults::default(), settings(3));
    assert_eq!(outcome.counts.runs, 1);
}

#[test]
fn previews_over_a_bad_line_have_no_wrong_pixel() {
    for seed in 1..4 {
        let faults = Faults {
            seed,
            bit_errors: 1e-4,
            dies_at: vec![5_000],
            restarts_at: if seed == 3 { vec![9_000] } else { Vec::new() },
            ..Faults::default()
        };
        let (outcome, images) = previewed(faults, None);
        assert!(
            matches!(outcome.ending, TransferEnd::Complete),
            "{outcome:?}"
        );
        assert!(images.len() >= 3, "{}", images.len());
        assert_eq!(images[images.len() - 1].sub_cpis.len(), MAPS / 2);
    }
}

#[test]
fn cancellation_after_a_preview_keeps_its_image() {
    let (outcome, images) = previewed(Faults::default(), Some(1));
    assert!(matches!(
        outcome.ending,
        TransferEnd::Failed(LinkError::Cancelled)
    ));
    assert!(images[1].sub_cpis.len() >= images[0].sub_cpis.len());
    assert!(images[1].sub_cpis.len() < MAPS / 2);
}

/// Observer that cancels after so many bytes from the module.
struct CancelAt {
    at: u64,
    bytes: u64,
}

impl SessionObserver for CancelAt {
    fn update(&mut self, counts: &Counts) {
        self.bytes = counts.bytes_to_module;
    }

    fn cancelled(&self) -> bool {
        self.bytes >= self.at
    }
}

#[test]
fn cancelled_transfer_keeps_the_image_so_far() {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut sub_cpis = Vec::new();
    // Of some 10,000 bytes.
    for at in [0, 6_000] {
        let mut job = job(&scene, &recording, Encoding::Complex32);
        let mut module = Module::start(Manner::default());
        let mut buffers = Buffers::new();
        let settings = settings(3);
        let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
        let mut cancel = CancelAt { at, bytes: 0 };
        let (outcome, image) = session.accumulate(&mut job, COHERENT, &mut cancel);
        println!(
            "{at}: {} sub-CPIs, {}",
            image.sub_cpis.len(),
            outcome.counts
        );
        assert!(
            matches!(outcome.ending, TransferEnd::Failed(LinkError::Cancelled)),
            "{outcome:?}"
        );
        judge_image(&image);
        assert_eq!(outcome.missing.len() + 2 * image.sub_cpis.len(), MAPS);
        assert_eq!(
            image.sub_cpis.is_empty(),
            image.chips.iter().all(Option::is_none)
        );
        sub_cpis.push(image.sub_cpis.len());
    }
    assert_eq!(sub_cpis[0], 0);
    assert!((1..MAPS / 2).contains(&sub_cpis[1]), "{sub_cpis:?}");
}

#[test]
fn restarted_module_accumulates_from_the_start() {
    for at in [4_321, 7_000, 9_500] {
        let faults = Faults {
            restarts_at: vec![at, at + 3_000],
            ..Faults::default()
        };
        let (outcome, _) = complete(faults, settings(3));
        assert!(outcome.counts.restarts >= 1, "{outcome:?}");
        assert!(outcome.counts.pulses_sent > PULSES as u64);
    }
}

#[test]
fn all_faults_together_still_deliver_the_image() {
    for seed in 20..26 {
        let faults = Faults {
            seed,
            bit_errors: 2e-5,
            cuts: 1e-4,
            dropped_pulses: 0.05,
            dies_at: vec![9_000],
            restarts_at: vec![6_000, 15_000],
            stalls_at: vec![(7_000, Duration::from_millis(200))],
        };
        complete(faults, settings(200));
    }
}

/// A second image in the same session does not continue the first.
#[test]
fn second_image_of_a_session_starts_empty() {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut module = Module::start(Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(3), &mut Silent).unwrap();
    let mut images = Vec::new();
    for _ in 0..2 {
        let mut job = job(&scene, &recording, Encoding::Complex32);
        let (outcome, image) = session.accumulate(&mut job, COHERENT, &mut Silent);
        assert!(matches!(outcome.ending, TransferEnd::Complete));
        judge_image(&image);
        images.push(image);
    }
    assert_eq!(images[0], images[1]);
}

/// Power of the chips, with faults on the line.
fn power(faults: Faults, retries: u32) -> (Outcome, AccumulatedImage) {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let mut module = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let settings = settings(retries);
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let (outcome, image) = session.accumulate(&mut job, POWER, &mut Silent);
    println!("{}", outcome.counts);
    (outcome, image)
}

/// The mean over the sub-CPIs of the power of each one's image, against a float64 sum over all pulses and frequencies.
#[test]
fn power_image_matches_exact_sum() {
    let scene = image_scene();
    let (outcome, image) = power(Faults::default(), 0);
    assert!(matches!(outcome.ending, TransferEnd::Complete));
    let blocks: Vec<_> = (0..PULSES)
        .step_by(4)
        .map(|n| n..PULSES.min(n + 4))
        .collect();
    let (mut error, mut whole) = (0.0, 0.0);
    for (grid, chip) in CHIPS.iter().zip(&image.chips) {
        let mut received = chip.as_ref().unwrap().iter();
        for row in 0..grid.num_rows {
            for column in 0..grid.num_columns {
                let point_m = [0, 1, 2].map(|i| {
                    grid.origin_m[i]
                        + f64::from(column) * grid.column_step_m[i]
                        + f64::from(row) * grid.row_step_m[i]
                });
                let looks = blocks
                    .iter()
                    .map(|block| scene.image_at(block.clone(), point_m).norm_sqr());
                let exact = looks.sum::<f64>() / blocks.len() as f64;
                let pixel = received.next().unwrap();
                assert_eq!(pixel.im, 0.0);
                error += (f64::from(pixel.re) - exact).powi(2);
                whole += exact * exact;
            }
        }
    }
    let error_db = 10.0 * (error / whole).log10();
    println!("{error_db:.1} dB");
    assert!(error_db < -60.0, "{error_db}");
}

#[test]
fn power_image_over_bad_line_equals_that_of_core() {
    let faults = Faults {
        seed: 9,
        bit_errors: 1e-4,
        restarts_at: vec![5_000],
        ..Faults::default()
    };
    let (outcome, image) = power(faults, 1000);
    assert!(
        matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut core = HostCore::new(job(&scene, &recording, Encoding::Complex32)).unwrap();
    assert_eq!(
        image,
        by_host_core(&mut core, POWER, &image.sub_cpis).unwrap()
    );
}

const CFAR: Cfar = Cfar {
    range: TrainingWindow {
        guard: 1,
        training: 3,
    },
    doppler: TrainingWindow {
        guard: 1,
        training: 2,
    },
    false_alarm_probability: 0.1,
};

/// Received lists by sub-CPI and patch.
#[derive(Default)]
struct Lists(std::collections::BTreeMap<Key, Vec<ChannelDetection>>);

impl DetectionSink for Lists {
    fn accept(
        &mut self,
        sub_cpi: u32,
        patch: u16,
        list: &[ChannelDetection],
    ) -> Result<(), SinkError> {
        let before = self.0.insert((sub_cpi, patch), list.to_vec());
        assert!(before.is_none(), "a list came twice");
        Ok(())
    }
}

#[test]
fn lag_needs_two_channels_displaced_along_the_track() {
    let [first, second] = dpca_scene::recordings();
    let (first, second) = (first.collection(), second.collection());
    for channels in [&[first][..], &[first, second, first]] {
        let found = channels.len() as u16;
        assert_eq!(lag_pulses(channels), Err(DpcaError::Channels { found }));
    }
    assert_eq!(lag_pulses(&[first, first]), Err(DpcaError::NoLag));
    let exchanged = lag_pulses(&[second, first]).unwrap();
    assert!((exchanged - 0.5).abs() < 2e-3, "{exchanged}");
    // A radar at rest.
    let mut still = [first.clone(), second.clone()];
    for channel in &mut still {
        let place = channel.pulses[0];
        channel.pulses.fill(place);
    }
    let [first, second] = &still;
    assert_eq!(lag_pulses(&[first, second]), Err(DpcaError::NotFinite));
}

#[test]
fn detections_after_cancellation_over_a_faulty_line_are_those_of_the_core() {
    let recordings = dpca_scene::recordings();
    let detector = dpca_scene::detector(&recordings);
    let own = &mut dpca_scene::job(&recordings, &detector, Encoding::Complex32);
    let expected = dpca_scene::expected_of(own, &detector);
    for seed in 0..3 {
        let faults = Faults {
            seed,
            bit_errors: f64::from(seed as u32) * 2e-5,
            ..Faults::default()
        };
        let mut job = dpca_scene::job(&recordings, &detector, Encoding::Complex32);
        let mut module = Module::behind(faults, Manner::default());
        let (mut buffers, mut lists) = (Buffers::new(), Lists::default());
        let mut session =
            Session::open(&mut module, &mut buffers, settings(100), &mut Silent).unwrap();
        let outcome = session.detect(&mut job, &detector, &mut lists, &mut Silent);
        assert!(
            matches!(outcome.ending, TransferEnd::Complete),
            "{outcome:?}"
        );
        // Six sub-CPIs, two patches.
        assert_eq!(lists.0.len(), 12);
        assert_eq!(lists.0, expected);
    }
}

#[test]
fn detections_over_a_faulty_line_are_those_of_the_core() {
    let scene = image_scene();
    let recording = recorded(&scene);
    for seed in 0..4 {
        let faults = Faults {
            seed,
            bit_errors: f64::from(seed as u32) * 2e-5,
            restarts_at: if seed == 3 { vec![6_000] } else { Vec::new() },
            ..Faults::default()
        };
        let mut job = job(&scene, &recording, Encoding::Complex32);
        let mut module = Module::behind(faults, Manner::default());
        let mut buffers = Buffers::new();
        let mut lists = Lists::default();
        let mut session =
            Session::open(&mut module, &mut buffers, settings(100), &mut Silent).unwrap();
        let outcome = session.detect(
            &mut job,
            &Detector {
                cfar: CFAR,
                dpca: None,
            },
            &mut lists,
            &mut Silent,
        );
        assert!(
            matches!(outcome.ending, TransferEnd::Complete),
            "{outcome:?}"
        );
        assert_eq!(lists.0.len(), MAPS);
        let mut total = 0;
        for (key, (header, values)) in expected(&scene) {
            let map = PatchMap {
                header,
                samples: MapSamples::Float(&values),
            };
            let mut columns = vec![Column::EMPTY; header.patch.num_range_bins()];
            let mut own = heapless::Vec::<Detection, 32>::new();
            CFAR.detect_in_map(&map, &mut columns, &mut own).unwrap();
            let own_values = own.iter().map(|detection| {
                let (doppler_bin, range_bin) = detection.cell();
                ChannelDetection {
                    detection: *detection,
                    values: vec![map.at(doppler_bin, range_bin)],
                }
            });
            assert!(lists.0[&key].iter().cloned().eq(own_values));
            total += own.len();
        }
        assert!(total > MAPS, "{total}");
    }
}
