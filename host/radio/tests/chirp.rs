//! Chirp radar: response against written-out spectra, and capture, recording and ranges with the simulated radio.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use num_complex::Complex64;
use subaperture_describe::Description;
use subaperture_radio::chirp::{Plan, capture};
use subaperture_radio::experiment::ChirpExperiment;
use subaperture_radio::live::{BurstView, LiveBurst, View};
use subaperture_radio::profile::{ChirpResponse, Options, Ranging, Sweep};
use subaperture_radio::sigmf::{Recording, Setup, Step};
use subaperture_radio::simulated::{Analogue, SimulatedRadio, Wiring};
use subaperture_radio::{Ranges, Sample};

use crate::scene::{experiment, half_path_m};

const RADIO: &str = "[radio]\nmaster_clock = \"20.48 MHz\"\nsample_rate = \"20.48 MHz\"\nbandwidth = \"20.48 MHz\"\n";

fn plan(chirp: &str) -> Result<Plan, String> {
    let device = "[device]\nkind = \"replay\"\nrecording = \"none\"\n";
    let text = format!("[chirp]\n{chirp}\n{RADIO}{device}");
    let described = ChirpExperiment::describe(&Description::new("chirp.toml", text, "."));
    described
        .map(|it| it.plan)
        .map_err(|error| error.to_string())
}

/// Counts of both channels for pulses with a chirp of 64 samples: a reference delayed by 2.3 samples, two echoes, and
/// phases that drift.
fn channels(plan: &Plan, pulses: usize) -> [Vec<Sample>; 2] {
    let (count, period) = (64.0, plan.period());
    let rate_hz = plan.radio.sample_rate_hz;
    let slope = plan.bandwidth_hz / plan.duration_s;
    let chirp = |at: f64| {
        let t = (at - 0.5 * (count - 1.0)) / rate_hz;
        match (-0.5..count - 0.5).contains(&at) {
            true => Complex64::cis(PI * slope * t * t),
            false => Complex64::ZERO,
        }
    };
    let total = plan.period() * pulses;
    let paths: [&[(f64, f64, f64)]; 2] = [&[(2.3, 0.4, 0.3)], &[(9.0, 0.1, 1.1), (21.6, 0.2, 2.0)]];
    paths.map(|paths| {
        let sample = |n: usize| {
            let mut sum = Complex64::ZERO;
            for (delay, amplitude, phase) in paths {
                // This pulse and the previous one.
                for pulse in (n / period).saturating_sub(1)..=n / period {
                    let at = (n - pulse * period) as f64 - delay;
                    sum += chirp(at) * Complex64::from_polar(*amplitude, phase + 1e-3 * n as f64);
                }
            }
            Sample::new((sum.re * 3e4).round() as i16, (sum.im * 3e4).round() as i16)
        };
        (0..total).map(sample).collect()
    })
}

/// The sums of the documentation, written out over the samples. Both are float64, so that they differ only by rounding of some thousand
/// terms. With the shorter interval the farthest echo arrives after the next pulse has begun.
#[test]
fn response_equals_written_out_ratio_of_spectra() {
    for interval in ["9.765625 us", "4.8828125 us"] {
        let text = format!(
            "bandwidth = \"16 MHz\"\nduration = \"3.125 us\"\ninterval = \"{interval}\"\nreach = \"290 m\""
        );
        let plan = plan(&text).unwrap();
        let (both, setup) = (channels(&plan, 5), setup(&plan));
        let found = response(&setup, &both, &[]).sweep();
        let (period, band) = (plan.period(), setup.band());
        assert_eq!(band.step_hz, 20.48e6 / period as f64);
        assert!(band.step_hz * band.count as f64 <= 0.8 * 16e6 + band.step_hz);
        for (n, value) in found.values.iter().enumerate() {
            let line = n as f64 - (band.count / 2) as f64;
            let spectrum = |samples: &[Sample], pulse: usize| -> Complex64 {
                let own = &samples[pulse * period..(pulse + 1) * period];
                let turned = own.iter().enumerate().map(|(i, s)| {
                    let z = Complex64::new(f64::from(s.re), f64::from(s.im));
                    z * Complex64::cis(-TAU * line * i as f64 / period as f64)
                });
                turned.sum()
            };
            let (mut product, mut power) = (Complex64::ZERO, 0.0);
            for pulse in 1..5 {
                let [reference, echo] = [0, 1].map(|c| spectrum(&both[c], pulse));
                product += echo * reference.conj();
                power += reference.norm_sqr();
            }
            let off = (value.unwrap() - product / power).norm();
            assert!(off < 1e-9, "{n}: {off}");
        }
        // Two echoes of 0.1 and 0.2 over a reference of 0.4; at delays of 6.7 and 19.3 samples. Sixteen bits of 64 samples: about -80 dB.
        let echoes = found.scatterers(40.0, 290.0).unwrap();
        assert_eq!(echoes.len(), 2, "{echoes:?}");
        for (one, (delay, amplitude)) in echoes.iter().zip([(6.7, 0.25), (19.3, 0.5)]) {
            let off = one.range_m / plan.spacing_m() - delay;
            println!("{interval}: {off:.4} samples, {:.4}", one.amplitude.norm());
            // A delayed chirp is sampled, not band-limited: the sum has the steps at its ends.
            assert!(off.abs() < 0.05, "{one:?}");
            assert!(
                (one.amplitude.norm() / amplitude - 1.0).abs() < 0.05,
                "{one:?}"
            );
        }
    }
}

fn setup(plan: &Plan) -> Setup {
    Setup {
        name: String::new(),
        hardware: String::new(),
        sample_rate_hz: plan.radio.sample_rate_hz,
        period: plan.period(),
        samples: plan.samples(),
        start_hz: plan.carrier_hz,
        step_hz: plan.bandwidth_hz,
        steps: 1,
        transmit_gain_db: 0.0,
        receive_gain_db: [0.0; 2],
        receive_antennas: Default::default(),
        reference: Default::default(),
        antennas: None,
        reach_m: None,
    }
}

fn response(setup: &Setup, both: &[Vec<Sample>; 2], lost: &[(usize, usize)]) -> ChirpResponse {
    let step = Step {
        start: 0,
        samples: both[0].len(),
        lower_hz: 0.0,
        upper_hz: 1.0,
        carrier_hz: setup.start_hz,
        sweep: 0,
        step: 0,
        time_s: 0.0,
        gain_db: [0.0; 2],
        bursts: 1,
        flags: Vec::new(),
        lost: lost.to_vec(),
    };
    let mut response = ChirpResponse::new(setup);
    response.add(&step, [&both[0], &both[1]]);
    response
}

#[test]
fn pulses_with_lost_samples_are_skipped() {
    let plan = plan("bandwidth = \"16 MHz\"\nduration = \"3.125 us\"\ninterval = \"9.765625 us\"\nreach = \"290 m\"").unwrap();
    let mut both = channels(&plan, 5);
    let (setup, period) = (setup(&plan), plan.period());
    let whole = response(&setup, &both, &[]);
    assert_eq!(whole.pulses(), [4, 0]);
    // Pulse 1 has a gap, whose samples are zero; pulse 2 lacks its echoes.
    let gap = (period + 50, period + 130);
    both.iter_mut()
        .for_each(|samples| samples[gap.0..gap.1].fill(Sample::ZERO));
    let rest = response(&setup, &both, &[gap]);
    assert_eq!(rest.pulses(), [2, 2]);
    let pairs = whole.sweep().values.into_iter().zip(rest.sweep().values);
    for (whole, rest) in pairs {
        // The phases drift from pulse to pulse in both channels alike; 16 bits.
        assert!((whole.unwrap() - rest.unwrap()).norm() < 0.01);
    }
    let none = response(&setup, &both, &[(0, 5 * period)]);
    assert_eq!(none.pulses(), [0, 4]);
    assert!(none.sweep().scatterers(40.0, 290.0).is_err());
}

/// C 5.4: 1.2 GHz, 20.48 MS/s. Two of the reflectors are 2.3 resolutions apart. The recording, read again, gives the emitted responses.
#[test]
fn thesis_chirp_radar_measures_ranges_within_the_stated_deviations() {
    let plan = plan("bandwidth = \"16 MHz\"\npulses = 4\nbursts = 2\nreach = \"300 m\"").unwrap();
    plan.check(&Ranges::b210()).unwrap();
    assert!((plan.resolution_m() - 9.37).abs() < 0.005);
    assert!((plan.spacing_m() - 7.32).abs() < 0.005);
    assert_eq!((plan.chirp_samples(), plan.period()), (1024, 4096));
    let folder = tempfile::tempdir().unwrap();
    // Equally strong at the antenna: cross section grows as the fourth power of range.
    let far_m = 120.0 + 3.0 * plan.spacing_m();
    let points = [
        (60.0, 8e3),
        (120.0, 1.28e5),
        (far_m, 1.28e5 * (far_m / 120.0).powi(4)),
    ];
    let experiment = experiment(&points, 21);
    // Loopback and antenna cables have equal delays, so that ranges are those of the scene.
    let wiring = Wiring::loopback(15e-9, 15e-9, None);
    let mut radio = SimulatedRadio::new(&experiment, wiring, Analogue::b210()).unwrap();
    let path = folder.path().join("chirps");
    let mut emitted = Vec::new();
    let mut live = Vec::new();
    let mut emit = |burst: LiveBurst| {
        emitted.push(burst.response.clone());
        live.push(burst);
    };
    let stop = AtomicBool::new(false);
    let summary = capture(&mut radio, &plan, Some(&path), &mut emit, &stop).unwrap();
    assert_eq!((summary.bursts, summary.pulses), (2, [6, 0]));
    assert_eq!(summary.flagged, [0; 3], "{summary:?}");
    let mut recording = Recording::open(&path).unwrap();
    assert_eq!(recording.steps().len(), 2);
    assert_ranges(&mut recording, &points);
    let mut ranging = Ranging::new(recording.setup(), Options::default()).unwrap();
    for (sweep, emitted) in emitted.iter().enumerate() {
        let read = ranging.read(&mut recording, sweep as u64).unwrap();
        assert!(read[0].values == emitted.values);
    }
    assert_view(recording.setup(), &live, &emitted);
    // The synthesisers' phases differ from burst to burst and cancel.
    let pairs = emitted[0].values.iter().zip(&emitted[1].values);
    let common: Complex64 = pairs.map(|(a, b)| a.unwrap() * b.unwrap().conj()).sum();
    assert!(common.arg().abs() < 0.05, "{common}");
}

/// The view shows each burst as a sweep: its profile is that of the response, and a row of the board has its maxima.
fn assert_view(setup: &Setup, bursts: &[LiveBurst], responses: &[Sweep]) {
    let view = View {
        columns: 100,
        ..View::default()
    };
    let window = view.window;
    let (mut shown, board) = BurstView::new(setup, 2, view).unwrap();
    for (burst, response) in bursts.iter().zip(responses) {
        let sweep = shown.take(&board, burst.clone());
        assert_eq!(sweep.receivers.len(), 1);
        assert!(sweep.receivers[0].values == response.values);
        let profile = response.profile(window, 4, 300.0).unwrap();
        assert!(sweep.profile.unwrap().values == profile.values);
        let row = board.latest_row().unwrap();
        assert_eq!((row.sweep, row.levels_db.len()), (burst.index, 100));
        let range_m = |i: usize| i as f64 * profile.spacing_m;
        let within = (0..profile.values.len()).filter(|&i| range_m(i) <= 300.0);
        let largest = within
            .map(|i| profile.values[i].norm_sqr())
            .fold(0.0, f64::max);
        let shown_db = row
            .levels_db
            .iter()
            .copied()
            .fold(f32::NEG_INFINITY, f32::max);
        // Rounding to float32.
        assert!((f64::from(shown_db) - 10.0 * largest.log10()).abs() < 1e-4);
    }
    let (status, _) = board.status();
    assert_eq!((status.sweep, status.sweeps), (Some(1), 2));
    assert_eq!(
        (status.steps, status.usable),
        (setup.band().count, setup.band().count)
    );
    assert_eq!((status.counts.steps, status.counts.flagged), (2, [0; 5]));
    // The reference has 0.7 of full scale in a quarter of the time.
    assert!(
        status.levels[0].rms > 0.0 && status.levels[0].peak <= 1.0,
        "{:?}",
        status.levels
    );
    assert_eq!(status.ranges_m[0], 0.0);
}

/// Ranges by the ratio of the spectra, all estimated together: within five of their stated standard deviations, which are below
/// 5 cm. Each of the 3 pulses used has noise of -20 dB per sample of 4096, and echoes of 0 dB
/// in 1024.
fn assert_ranges(recording: &mut Recording, points: &[(f64, f64)]) {
    let mut ranging = Ranging::new(recording.setup(), Options::default()).unwrap();
    assert_eq!(ranging.reach_m(), 300.0);
    for sweep in 0..2 {
        let found = ranging.read(recording, sweep).unwrap()[0]
            .scatterers(30.0, 300.0)
            .unwrap();
        println!("{found:.4?}");
        assert_eq!(found.len(), 3, "{found:?}");
        for (one, (at_m, _)) in found.iter().zip(points) {
            let off_m = one.range_m - half_path_m(*at_m);
            println!("{at_m} m: {off_m:+.4} m, deviation {:.4} m", one.sigma_m);
            assert!(off_m.abs() < 5.0 * one.sigma_m, "{one:?}");
            assert!(one.sigma_m < 0.05, "{one:?}");
        }
    }
    let error = ranging.read(recording, 2).unwrap_err();
    assert!(error.to_string().contains("no sweep 2"), "{error}");
}

#[test]
fn invalid_chirp_plans_are_refused_with_reason() {
    let refused = |text: &str, words: &str| {
        let error = plan(text).unwrap().check(&Ranges::b210()).unwrap_err();
        assert!(error.to_string().contains(words), "{text}: {error}");
    };
    refused("bandwidth = \"25 MHz\"", "chirp bandwidth of 25000000 Hz");
    refused(
        "bandwidth = \"16 MHz\"\ninterval = \"33.3333 us\"",
        "expected a whole number",
    );
    refused(
        "bandwidth = \"16 MHz\"\nduration = \"250 us\"",
        "no longer than the interval",
    );
    refused(
        "bandwidth = \"16 MHz\"\nduration = \"0.1 us\"",
        "chirp of 2 samples",
    );
    refused(
        "bandwidth = \"16 MHz\"\nreach = \"40 km\"",
        "unambiguous range of 29979.2 m",
    );
    refused(
        "bandwidth = \"16 MHz\"\npulses = 100000",
        "Send fewer pulses",
    );
    refused(
        "bandwidth = \"16 MHz\"\ncarrier = \"9 GHz\"",
        "carrier of 9000000000 Hz",
    );
    assert!(
        plan("carrier = \"1.2 GHz\"")
            .unwrap_err()
            .contains("bandwidth")
    );
    let reference = subaperture_radio::experiment::chirp_reference();
    assert!(reference.contains("interval") && reference.contains("receive_gain"));
}
