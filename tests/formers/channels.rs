//! Coherent sum of channels by every former for any track, against a sum over channels, pulses and frequencies written out here.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::rdbp::RangeDopplerBackprojection;
use subaperture::focus::{FormError, Formed, ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{ChannelError, Channels, InMemory, Joined, PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Experiment, Scatterer};
use subaperture_tests::experiment::{IDEAL, antenna, experiment, five_points, point, read_whole};

/// Pulses of each channel.
const TURNS: usize = 192;

/// A radar with `transmitters` antennas 15 cm apart in height, transmitting in turn, and two receivers 40 cm apart along the track.
fn radar(transmitters: usize, points: Vec<Scatterer>) -> Experiment {
    let mut experiment = experiment(IDEAL, points);
    let up = |i: usize| antenna(&format!("tx{i}"), DVec3::Z * (0.15 * i as f64));
    experiment.radar.transmitters = (0..transmitters).map(up).collect();
    experiment.radar.receivers = vec![antenna("fore", DVec3::X * 0.4), antenna("aft", DVec3::ZERO)];
    experiment.radar.num_pulses = TURNS * transmitters;
    experiment.radar.pri_s = 1e-3 / transmitters as f64;
    experiment
}

fn form(
    former: &dyn ImageFormer,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    slow: Window,
) -> Result<Formed, FormError> {
    former.form(&Task {
        memory_bytes: 1 << 28,
        ..Task::new(
            history,
            grid,
            &Weights::new(history.collection(), Window::None, slow),
        )
    })
}

/// Matched-filter sum over all channels, pulses and frequencies, divided by their count.
fn sum_over_all(channels: &Channels, grid: &ImageGrid) -> Vec<Complex64> {
    let mut pixels = vec![Complex64::ZERO; grid.rows.count * grid.columns.count];
    let mut count = 0;
    for (_, history) in channels.iter() {
        let collection = history.collection();
        let samples = read_whole(history);
        count += samples.len();
        for (pulse, row) in (collection.pulses.iter()).zip(samples.chunks(collection.num_samples)) {
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let (row_of, column) = (i / grid.columns.count, i % grid.columns.count);
                let at = grid.position_m(row_of, column);
                let [out, back] =
                    [pulse.transmitter_m, pulse.receiver_m].map(|antenna| at - antenna);
                let norm = |v: DVec3| (v.x * v.x + v.y * v.y + v.z * v.z).sqrt();
                let delay_s = (norm(out) + norm(back) - pulse.reference_path_m) / 299_792_458.0;
                let turned = |hz: f64| Complex64::cis(TAU * (hz * delay_s).fract());
                let (mut phasor, step) = (turned(pulse.start_hz), turned(pulse.step_hz));
                for z in row {
                    *pixel += Complex64::new(z.re.into(), z.im.into()) * phasor;
                    phasor *= step;
                }
            }
        }
    }
    pixels.iter().map(|sum| sum / count as f64).collect()
}

fn error_db(pixels: &[Complex32], expected: &[Complex64]) -> f64 {
    let (mut error, mut power) = (0.0, 0.0);
    for (z, e) in pixels.iter().zip(expected) {
        error += (Complex64::new(z.re.into(), z.im.into()) - e).norm_sqr();
        power += e.norm_sqr();
    }
    10.0 * (error / power).log10()
}

/// The pulses of all channels in order of time.
fn in_turn(channels: &Channels) -> InMemory {
    let mut collection = channels.channel(0).collection().clone();
    collection.pulses.clear();
    let mut samples = Vec::new();
    let all: Vec<Vec<Complex32>> = channels
        .iter()
        .map(|(_, history)| read_whole(history))
        .collect();
    let width = collection.num_samples;
    for n in 0..channels.num_pulses() {
        for (own, (_, history)) in all.iter().zip(channels.iter()) {
            collection.pulses.push(history.collection().pulses[n]);
            samples.extend_from_slice(&own[n * width..(n + 1) * width]);
        }
    }
    InMemory::new(collection, samples).unwrap()
}

/// Patches of one level, whose plan states the length of a sub-CPI.
fn single_level() -> RangeDopplerBackprojection {
    RangeDopplerBackprojection::default().patch_m(8.0)
}

#[test]
fn formers_keep_bound_on_sum_of_channels() {
    let grid: ImageGrid = "x=-16:16:0.83,y=-16:16:0.79,z=0".parse().unwrap();
    for transmitters in [1, 2] {
        let experiment = radar(transmitters, five_points());
        let channels = experiment.channels(1 << 26).unwrap();
        assert_eq!(channels.len(), 2 * transmitters);
        let expected = sum_over_all(&channels, &grid);
        let one = form(&single_level(), channels.channel(0), &grid, Window::None).unwrap();
        let interleaved = in_turn(&channels);
        let sum = channels.coherent_sum().unwrap();
        let omega_k = OmegaK::default();
        let [bp, rdbp] = [
            &Backprojection::default() as &dyn ImageFormer,
            &RangeDopplerBackprojection::default(),
        ];
        let ffbp = FastFactorised::default();
        let mut formers: Vec<&dyn ImageFormer> = vec![&Exact, bp, rdbp, &ffbp];
        if transmitters == 1 {
            // Two receivers next to each other pass the same positions in turn; omega-k accepts this.
            formers.push(&omega_k);
        } else {
            // A second transmitter at another height does not lie on the line of the first.
            let refused = form(&omega_k, &sum, &grid, Window::None).unwrap_err();
            assert!(
                matches!(refused, FormError::BoundMissed { .. }),
                "{refused}"
            );
        }
        for former in formers {
            let formed = form(former, &sum, &grid, Window::None).unwrap();
            let measured_db = error_db(&formed.image.pixels, &expected);
            println!(
                "{} channels, {}: {measured_db:.1} dB, predicted {:.1} dB",
                2 * transmitters,
                former.name(),
                formed.predicted_error_db
            );
            // Pixels of the exact sum are rounded to float32.
            assert!(
                measured_db < former.bound_db().unwrap_or(-140.0),
                "{}",
                former.name()
            );
            assert!(
                measured_db < formed.predicted_error_db + 1.0,
                "{}",
                former.name()
            );
        }
        // Sub-CPIs have the length of one channel's; interleaved channels would give each sub-CPI that many fewer pulse times.
        let pulses = |formed: &Formed| formed.settings["sub_cpi_pulses"].as_u64().unwrap();
        let rdbp = single_level();
        let together = form(&rdbp, &sum, &grid, Window::None).unwrap();
        let mixed = form(&rdbp, &interleaved, &grid, Window::None);
        println!(
            "sub-CPIs: one channel {}, sum {}, in turn {:?}",
            pulses(&one),
            pulses(&together),
            mixed.as_ref().map(pulses).map_err(ToString::to_string)
        );
        assert_eq!(pulses(&together), pulses(&one));
    }
}

/// So few pulses of each channel that the step between channels does not stand out.
#[test]
fn formers_keep_bound_with_few_pulses_per_channel() {
    let grid: ImageGrid = "x=-16:16:2.3,y=-16:16:2.1,z=0".parse().unwrap();
    for turns in [1, 2, 5] {
        let mut experiment = radar(2, five_points());
        experiment.radar.num_pulses = 2 * turns;
        let channels = experiment.channels(1 << 26).unwrap();
        let expected = sum_over_all(&channels, &grid);
        let sum = channels.coherent_sum().unwrap();
        let formers: [&dyn ImageFormer; 3] = [
            &Backprojection::default(),
            &RangeDopplerBackprojection::default(),
            &FastFactorised::default(),
        ];
        for former in formers {
            let formed = form(former, &sum, &grid, Window::None).unwrap();
            let measured_db = error_db(&formed.image.pixels, &expected);
            println!("{turns} turns, {}: {measured_db:.1} dB", former.name());
            assert!(measured_db < -60.0, "{turns}: {}", former.name());
        }
    }
}

#[test]
fn unit_scatterer_has_amplitude_one_with_any_number_of_channels() {
    let grid: ImageGrid = "x=-2:2:0.5,y=-2:2:0.5,z=0".parse().unwrap();
    for transmitters in [1, 2, 3] {
        let experiment = radar(transmitters, vec![point(1.0, -0.5, 1.0)]);
        let sum = experiment
            .channels(1 << 26)
            .unwrap()
            .coherent_sum()
            .unwrap();
        for slow in [Window::None, Window::default(), Window::Hamming] {
            for former in [
                &Exact as &dyn ImageFormer,
                &RangeDopplerBackprojection::default(),
            ] {
                let formed = form(former, &sum, &grid, slow).unwrap();
                // Row 3 is y = -0.5, column 6 x = 1.
                let got = formed.image.pixels[3 * grid.columns.count + 6];
                // -60 dB, or the rounding of samples.
                assert!((got - Complex32::ONE).norm() < 1e-3, "{slow}: {got}");
            }
        }
    }
}

/// Every channel has the same window, so the sum is the mean of the channels' images.
#[test]
fn window_is_the_same_for_every_channel() {
    let grid: ImageGrid = "x=-16:16:1.9,y=-16:16:1.7,z=0".parse().unwrap();
    for transmitters in [1, 3] {
        let experiment = radar(transmitters, five_points());
        let channels = experiment.channels(1 << 26).unwrap();
        let mut mean = vec![Complex64::ZERO; grid.num_pixels() as usize];
        for (_, history) in channels.iter() {
            let formed = form(&Exact, history, &grid, Window::default()).unwrap();
            for (sum, z) in mean.iter_mut().zip(&formed.image.pixels) {
                *sum += Complex64::new(z.re.into(), z.im.into()) / channels.len() as f64;
            }
        }
        let sum = channels.coherent_sum().unwrap();
        let formed = form(&Exact, &sum, &grid, Window::default()).unwrap();
        let off_db = error_db(&formed.image.pixels, &mean);
        // Rounded to float32 on both sides.
        assert!(off_db < -140.0, "{transmitters}: {off_db}");
        // The same as one recording whose pulses keep their order.
        let alone = Joined::alone(Box::new(
            InMemory::new(sum.collection().clone(), read_whole(&sum)).unwrap(),
        ));
        let formed_again = form(&Exact, &alone, &grid, Window::default()).unwrap();
        assert_eq!(formed.image.pixels, formed_again.image.pixels);
    }
}

#[test]
fn incomplete_turn_is_reported() {
    let mut experiment = radar(2, five_points());
    experiment.radar.num_pulses = 33;
    let error = experiment.channels(1 << 26).err().unwrap();
    let counts = ChannelError::Pulses {
        names: ["T1R1".to_owned(), "T2R1".to_owned()],
        counts: [17, 16],
    };
    assert_eq!(error.to_string(), counts.to_string());
    let about = experiment.about(experiment.pairs()[3]);
    assert_eq!(about.name, "T2R2");
    assert_eq!(about.transmitter.as_deref(), Some("tx1"));
    assert_eq!(about.receiver.as_deref(), Some("aft"));
}
