//! Self-test of the simulated radio: values near the simulated ones, and a failed check for each fault.

use subaperture_io::selftest::{Check, Report, Verdict};
use subaperture_radio::fault::{Faults, Faulty};
use subaperture_radio::plan::Plan;
use subaperture_radio::selftest::{Options, Tested, run};
use subaperture_radio::simulated::{Analogue, Coupled, Settling, SimulatedRadio, Wiring};
use subaperture_radio::{
    About, Burst, Configuration, Event, RadioError, Received, Sample, Sensors, Side, Transceiver,
};
use subaperture_simulate::Experiment;
use subaperture_simulate::scenario::Scenario;

use crate::scene::{experiment, plan};

/// Splitter from the transmitter to both receivers, with 15 and 25 ns of cable and amplitude 10. Full scale is 26 dB.
fn splitter(experiment: &Experiment, analogue: Analogue) -> SimulatedRadio<'_> {
    let second = Coupled {
        delay_s: 25e-9,
        amplitude: 10.0,
    };
    let wiring = Wiring::loopback(15e-9, 0.0, Some(second));
    SimulatedRadio::new(experiment, wiring, analogue).unwrap()
}

fn tested(radio: &mut dyn Transceiver, plan: &Plan, delay_s: Option<f64>) -> Report<Tested> {
    let options = Options {
        stream_s: 0.3,
        delay_s,
    };
    let report = run(radio, plan, &options, String::new());
    for check in &report.checks {
        println!("{check:?}");
    }
    report
}

fn check<'a>(report: &'a Report<Tested>, name: &str) -> &'a Check {
    let mut all = report.checks.iter();
    all.find(|check| check.name == name).expect("a known check")
}

fn value(report: &Report<Tested>, name: &str) -> f64 {
    check(report, name).value.expect("a value")
}

fn failed(report: &Report<Tested>) -> Vec<&str> {
    let failed = report.checks.iter();
    let failed = failed.filter(|check| check.verdict == Verdict::Failed);
    failed.map(|check| check.name.as_str()).collect()
}

/// The tone has 0.7 of amplitude 10 in each receiver, and noise has -20 dB per sample: 36.9 dB, and 66.9 dB over the
/// 1000 samples of a burst. The phase of the quotient has the noise of both: `sqrt(2 / (2 10^6.69))` = 4.5e-4 rad. DC
/// and images leak through an LO offset of up to 400 Hz by less than 400 / 125000 of 0.03, 1e-4 rad. Over 50 carriers,
/// 57.7 MHz RMS from their middle, that is a delay of `4.5e-4 / (2 pi 57.7 MHz sqrt(50))` = 0.18 ps.
#[test]
fn healthy_radio_passes_with_simulated_values() {
    let experiment = experiment(&[], 5);
    let mut radio = splitter(&experiment, Analogue::b210());
    let report = tested(&mut radio, &plan(""), Some(10e-9));
    assert!(report.passed && failed(&report).is_empty());
    assert!(report.about.simulated && report.about.serial == "SIM00001");
    // The delay's carriers are 2 ppm higher than stated.
    let delay_ns = value(&report, "loop-back delay");
    assert!((delay_ns - 10.0).abs() < 5.0 * 0.18e-3 + 2e-5, "{delay_ns}");
    let deviation_ns = value(&report, "loop-back delay: deviation");
    assert!((0.09e-3..0.36e-3).contains(&deviation_ns));
    let repeated_rad = value(&report, "phase repeatability");
    assert!((2.2e-4..9e-4).contains(&repeated_rad));
    assert_noise_db(&report, -46.0);
    let clock = check(&report, "reference clock: lock");
    assert_eq!(clock.verdict, Verdict::NotMeasured);
    assert_eq!(value(&report, "lost samples"), 0.0);
}

/// Noise of both receivers in dB below full scale. The gain of Q over I is 1.02 and 0.97, which changes the power by 0.09
/// and -0.13 dB. The power of 100000 samples deviates by 0.014 dB, and 12 bits and the quadrature errors add 0.02 dB.
fn assert_noise_db(report: &Report<Tested>, simulated_db: f64) {
    for (receiver, imbalance_db) in [(0, 0.087), (1, -0.13)] {
        let floor_db = value(report, &format!("noise floor: receiver {receiver}"));
        assert!(
            (floor_db - simulated_db - imbalance_db).abs() < 0.07,
            "{floor_db}"
        );
    }
}

/// A scene without noise and phase noise.
fn silent() -> Experiment {
    let text = r#"
        [radar]
        kind = "ideal"
        pulses = 1
        pri = "1 s"
        centre = "1.2 GHz"
        bandwidth = "200 MHz"
        samples = 50
        [platform]
        kind = "fixed"
        position = "0, 0, 0 m"
        [scene]
        reference = "6.3, 0, 0 m"
    "#;
    Scenario::new("scene.toml", text, ".").experiment().unwrap()
}

/// Deviation of the transient from a steady tone over 1 ms from `start_ms` on, by 18 samples: of the amplitude from its
/// mean, and of the phase from a least-squares line.
fn transient(start_ms: f64, time_constant_ms: f64) -> f64 {
    let times: Vec<f64> = (0..18)
        .map(|i| start_ms + (f64::from(i) + 0.5) / 18.0)
        .collect();
    let left = |t: f64| [t, t - 2.0].map(|t| (-t / time_constant_ms).exp());
    let amplitudes: Vec<f64> = times
        .iter()
        .map(|&t| left(t).map(|left| 1.0 - 0.3 * left).iter().product())
        .collect();
    let phases: Vec<f64> = times
        .iter()
        .map(|&t| 6.0 * (left(t)[0] - left(t)[1]))
        .collect();
    let mean = |all: &[f64]| all.iter().sum::<f64>() / 18.0;
    let (a, p, t) = (mean(&amplitudes), mean(&phases), mean(&times));
    let cross: f64 = times
        .iter()
        .zip(&phases)
        .map(|(x, y)| (x - t) * (y - p))
        .sum();
    let slope = cross / times.iter().map(|x| (x - t) * (x - t)).sum::<f64>();
    let off = times
        .iter()
        .zip(&phases)
        .map(|(x, y)| (y - p - slope * (x - t)).abs());
    let amplitude = amplitudes.iter().map(|x| (x / a - 1.0).abs());
    off.chain(amplitude).fold(0.0, f64::max)
}

/// The transmitter is tuned at 0, the receivers at 2 ms; the first sample is taken at 5 ms. The resolution is a block
/// of 56 samples, 0.056 ms; means over blocks deviate from samples in their middle by less than that too.
#[test]
fn retune_time_is_that_of_the_simulated_transient() {
    let experiment = silent();
    let analogue = Analogue {
        settling: Some(Settling {
            time_constant_s: 3e-3,
            phase_rad: 6.0,
            amplitude: 0.3,
        }),
        ..Analogue::default()
    };
    let report = tested(
        &mut splitter(&experiment, analogue),
        &plan("steady = 0.005\n"),
        None,
    );
    let mut steps = (0..2000).map(|i| 5.0 + 0.01 * f64::from(i));
    let last = steps.rfind(|&start_ms| transient(start_ms, 3.0) > 0.005);
    let expected_ms = last.expect("unsteady at first");
    let settled_ms = value(&report, "retune time");
    println!("{settled_ms} ms, expected {expected_ms} ms");
    assert!((settled_ms - expected_ms).abs() < 0.13);
    assert_eq!(report.about.retunes.len(), 8);
    // At 19 ms a capture takes its eighth burst; a transient of 20 ms is not over.
    let slow = Analogue {
        settling: Some(Settling {
            time_constant_s: 20e-3,
            phase_rad: 6.0,
            amplitude: 0.3,
        }),
        ..Analogue::default()
    };
    let slow = tested(
        &mut splitter(&experiment, slow),
        &plan("steady = 0.005\n"),
        None,
    );
    assert!(failed(&slow).contains(&"retune time"));
    assert_eq!(slow.about.retunes[0].settled_s, None);
}

#[test]
fn transport_faults_fail_their_checks() {
    for (faults, expected) in [
        (
            Faults {
                overflow: 0.1,
                ..Faults::default()
            },
            ["overruns", "lost samples"],
        ),
        (
            Faults {
                lost_packet: 0.1,
                ..Faults::default()
            },
            ["lost packets", "lost samples"],
        ),
        (
            Faults {
                underflow: 0.1,
                ..Faults::default()
            },
            ["underruns", "lost samples"],
        ),
        (
            Faults {
                late: 0.1,
                ..Faults::default()
            },
            ["late commands", "lost samples"],
        ),
    ] {
        let faults = Faults {
            packet: 120,
            seed: 3,
            ..faults
        };
        let experiment = experiment(&[], 5);
        let radio = splitter(&experiment, Analogue::b210());
        let report = tested(&mut Faulty::new(radio, faults), &plan(""), Some(10e-9));
        let failed = failed(&report);
        // A retune whose burst has lost samples has no time.
        let may_be = |name: &&str| expected.contains(name) || *name == "retune time";
        assert!(failed.iter().all(may_be), "{failed:?}");
        assert!(
            expected.iter().all(|name| failed.contains(name)),
            "{failed:?}"
        );
    }
}

#[test]
fn disconnection_is_reported_and_leaves_the_rest_unmeasured() {
    let experiment = experiment(&[], 5);
    let faults = Faults {
        unplug_at: Some(30),
        ..Faults::default()
    };
    let radio = splitter(&experiment, Analogue::b210());
    let report = tested(&mut Faulty::new(radio, faults), &plan(""), None);
    assert_eq!(failed(&report), ["driver errors"]);
    assert!(
        check(&report, "driver errors")
            .note
            .contains("disconnected")
    );
    for name in [
        "loop-back delay",
        "phase repeatability",
        "noise floor: receiver 0",
    ] {
        assert_eq!(check(&report, name).verdict, Verdict::NotMeasured, "{name}");
    }
    assert!(check(&report, "retune time").value.is_some());
}

#[test]
fn plan_outside_the_limits_of_the_radio_fails_with_its_reason() {
    let experiment = experiment(&[], 5);
    let mut radio = splitter(&experiment, Analogue::b210());
    let report = tested(&mut radio, &plan("pri = \"0.1 s\"\n"), None);
    assert_eq!(failed(&report), ["driver errors"]);
    assert!(
        check(&report, "driver errors")
            .note
            .contains("sweep interval")
    );
}

/// -26 dB of the loop's amplitude of 7 and a block of 56 samples permit noise of -4 dB; there are 0 dB.
#[test]
fn noise_above_the_limit_of_a_steady_reference_fails() {
    let mut noisy = experiment(&[], 5);
    let noise = noisy.radar.receiver.noise.as_mut().expect("noise");
    *noise = subaperture_model::radar::ThermalNoise::Relative { power_db: 0.0 };
    let report = tested(&mut splitter(&noisy, Analogue::b210()), &plan(""), None);
    assert!(failed(&report).contains(&"noise floor: receiver 0"));
    assert_noise_db(&report, -26.0);
}

#[test]
fn delay_other_than_expected_fails_alone() {
    let experiment = experiment(&[], 5);
    for (expected_s, fails) in [(12e-9, true), (8e-9, true), (11e-9, false), (9e-9, false)] {
        let mut radio = splitter(&experiment, Analogue::b210());
        let report = tested(&mut radio, &plan(""), Some(expected_s));
        assert_eq!(
            failed(&report) == ["loop-back delay"],
            fails,
            "{expected_s}"
        );
        assert_eq!(report.passed, !fails);
    }
}

#[test]
fn receiver_at_full_scale_fails_the_clipping_check() {
    let experiment = experiment(&[], 5);
    let mut plan = plan("");
    plan.radio.receive_gain_db[1] = 52.0;
    let report = tested(&mut splitter(&experiment, Analogue::b210()), &plan, None);
    assert!(failed(&report).contains(&"clipping"));
    let note = &check(&report, "clipping").note;
    assert!(note.contains("receiver 0: 0, receiver 1: "), "{note}");
}

/// A radio whose receivers never lock, or whose second receiver has another phase after each retune.
struct Spoiled<T> {
    radio: T,
    unlocked: bool,
    unstable: bool,
    retunes: usize,
}

impl<T: Transceiver> Transceiver for Spoiled<T> {
    fn about(&self) -> &About {
        self.radio.about()
    }
    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        self.radio.configure(asked)
    }
    fn now_s(&mut self) -> Result<f64, RadioError> {
        self.radio.now_s()
    }
    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        self.retunes += usize::from(side == Side::Receive);
        self.radio.tune(side, carrier_hz, at_s)
    }
    fn burst(
        &mut self,
        burst: &Burst,
        receive: [&mut [Sample]; 2],
    ) -> Result<Received, RadioError> {
        let [first, second] = receive;
        let received = self.radio.burst(burst, [first, &mut *second])?;
        // 0.3 radians to both sides, in turn for each carrier of a cycle of four.
        let sign = if (self.retunes / 4).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let (sin, cos) = (0.3f64 * sign).sin_cos();
        for s in second.iter_mut().filter(|_| self.unstable) {
            let (i, q) = (f64::from(s.re), f64::from(s.im));
            *s = Sample::new((i * cos - q * sin) as i16, (i * sin + q * cos) as i16);
        }
        Ok(received)
    }
    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        let sensors = self.radio.sensors()?;
        Ok(Sensors {
            receive_locked: sensors.receive_locked && !self.unlocked,
            reference_locked: Some(!self.unlocked),
            ..sensors
        })
    }
    fn events(&mut self, events: &mut Vec<Event>) {
        self.radio.events(events);
    }
}

fn spoiled(unlocked: bool, unstable: bool) -> Report<Tested> {
    let experiment = experiment(&[], 5);
    let mut radio = Spoiled {
        radio: splitter(&experiment, Analogue::b210()),
        unlocked,
        unstable,
        retunes: 0,
    };
    tested(&mut radio, &plan(""), Some(10e-9))
}

#[test]
fn synthesiser_and_clock_without_lock_fail_their_checks() {
    let report = spoiled(true, false);
    assert_eq!(
        failed(&report),
        ["receivers: lock", "reference clock: lock"]
    );
    assert_eq!(value(&report, "transmitter: lock"), 0.0);
    assert_eq!(
        check(&spoiled(false, false), "reference clock: lock").verdict,
        Verdict::Passed
    );
}

/// Deviations of 0.3 rad to both sides of the mean of eight: `0.3 sqrt(8 / 7)` = 0.32 rad.
#[test]
fn phase_that_changes_from_retune_to_retune_fails() {
    let report = spoiled(false, true);
    assert_eq!(failed(&report), ["phase repeatability"]);
    assert!((value(&report, "phase repeatability") - 0.32).abs() < 0.01);
}
