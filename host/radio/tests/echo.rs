//! Simulated radio against its defining sums.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_radio::simulated::{Analogue, SimulatedRadio, Wiring};
use subaperture_radio::{Burst, EventKind, RadioError, Sample, Side, Transceiver};

use crate::scene::{experiment, half_path_m, plan};

const LIGHT_M_S: f64 = 299_792_458.0;

fn turn(turns: f64) -> Complex64 {
    let (sin, cos) = (TAU * (turns - turns.round())).sin_cos();
    Complex64::new(cos, sin)
}

/// Repeated chirp of 48 samples with a point target and the loopback path, without impairments. Each spectral line (a
/// sum written out) is delayed at its own frequency. Counts are rounded once, to steps of full scale over 32768, with a
/// full scale of 20: half a step in I and in Q. Rounding of the waveform to float32 is a hundredth of that.
#[test]
fn burst_equals_waveform_delayed_at_each_frequency() {
    let mut experiment = experiment(&[(6.3, 1.0)], 5);
    experiment.radar.receiver.noise = None;
    experiment.radar.receiver.phase_noise = None;
    experiment.radar.receiver.clock = None;
    experiment.radar.receiver.converter.as_mut().unwrap().bits = 16;
    let wiring = Wiring::loopback(15e-9, 20e-9, None);
    let mut radio = SimulatedRadio::new(&experiment, wiring, Analogue::default()).unwrap();
    radio.configure(&plan("").radio).unwrap();
    for side in [Side::Transmit, Side::Receive] {
        assert_eq!(radio.tune(side, 1.15e9, None).unwrap(), 1.15e9);
    }
    let period = 48;
    let chirp: Vec<Complex32> = (0..period)
        .map(|i| {
            let x = f64::from(i) / f64::from(period) - 0.5;
            let z = turn(10.0 * x * x) * 0.7;
            Complex32::new(z.re as f32, z.im as f32)
        })
        .collect();
    let mut buffers = [vec![Sample::ZERO; 101], vec![Sample::ZERO; 101]];
    let [a, b] = &mut buffers;
    let burst = Burst {
        waveform: &chirp,
        at_s: 1.0,
    };
    let received = radio.burst(&burst, [a, b]).unwrap();
    assert!(!received.late && received.lost.is_empty() && received.first_s == 1.0);
    let full_scale = 10f64.powf(1.3);
    let paths = [
        (15e-9, 10.0),
        (2.0 * half_path_m(6.3) / LIGHT_M_S + 20e-9, 1.0),
    ];
    // Spreading loss of both paths: the reference point is 6.3 m from the transmitter.
    let spreading = [1.0, 6.3 / (2.0 * half_path_m(6.3) - 6.3)];
    for (channel, (delay_s, amplitude)) in paths.into_iter().enumerate() {
        for t in 0..101 {
            let mut sum = Complex64::ZERO;
            for k in -24i32..24 {
                let line: Complex64 = (0..period)
                    .zip(&chirp)
                    .map(|(i, z)| {
                        Complex64::new(z.re.into(), z.im.into()) * turn(-f64::from(k * i) / 48.0)
                    })
                    .sum();
                let frequency_hz = 1.15e9 + f64::from(k) * 1e6 / 48.0;
                sum += line * turn(f64::from(k * t) / 48.0) * turn(-frequency_hz * delay_s) / 48.0;
            }
            let expected = sum * amplitude * spreading[channel] * 32768.0 / full_scale;
            let got = buffers[channel][t as usize];
            let off = Complex64::new(got.re.into(), got.im.into()) - expected;
            assert!(
                off.re.abs() < 0.52 && off.im.abs() < 0.52,
                "{channel} {t}: {got} {expected}"
            );
        }
    }
}

#[test]
fn late_burst_is_reported_and_burst_before_tuning_is_refused() {
    let experiment = experiment(&[(6.3, 1.0)], 5);
    let mut radio = crate::scene::radio(&experiment);
    let mut buffers = [vec![Sample::new(7, 7); 16], vec![Sample::new(7, 7); 16]];
    let waveform = [Complex32::ONE];
    let mut try_at = |radio: &mut SimulatedRadio, at_s: f64| {
        let [a, b] = &mut buffers;
        let burst = Burst {
            waveform: &waveform,
            at_s,
        };
        (radio.burst(&burst, [a, b]), a[0])
    };
    assert!(matches!(
        try_at(&mut radio, 0.0).0,
        Err(RadioError::NotReady(_))
    ));
    radio.configure(&plan("").radio).unwrap();
    assert!(matches!(
        radio.tune(Side::Transmit, 7e9, None),
        Err(RadioError::OutOfRange { .. })
    ));
    assert!(matches!(
        radio.tune(Side::Transmit, 1e9, Some(1.0)),
        Err(RadioError::Unsupported(_))
    ));
    radio.tune(Side::Transmit, 1e9, None).unwrap();
    radio.tune(Side::Receive, 1e9, None).unwrap();
    let (received, first) = try_at(&mut radio, 0.001);
    assert!(received.unwrap().late);
    assert_eq!(first, Sample::ZERO);
    let mut events = Vec::new();
    radio.events(&mut events);
    assert_eq!(events.len(), 1);
    assert_eq!(events[0].kind, EventKind::LateCommand);
    assert!(matches!(
        try_at(&mut radio, f64::NAN).0,
        Err(RadioError::Burst(_))
    ));
}

/// Repeated periods equal computed ones. A negligible LO offset forces computation of every period. The signal exceeds
/// full scale, so that clipping is counted in both cases.
#[test]
fn repeated_periods_equal_computed_ones_and_clip_equally() {
    let mut experiment = experiment(&[(6.3, 1.0)], 5);
    experiment.radar.receiver.noise = None;
    experiment.radar.receiver.phase_noise = None;
    let took = |frequency_offset_hz: f64| {
        let analogue = Analogue {
            frequency_offset_hz,
            ..Analogue::b210()
        };
        let wiring = crate::scene::wiring();
        let mut radio = SimulatedRadio::new(&experiment, wiring, analogue).unwrap();
        let plan = plan("[radio]\nreference_gain = \"50 dB\"\n");
        radio.configure(&plan.radio).unwrap();
        for side in [Side::Transmit, Side::Receive] {
            radio.tune(side, 1.15e9, None).unwrap();
        }
        let waveform: Vec<Complex32> = (0..8)
            .map(|i| {
                let z = turn(f64::from(i) / 8.0) * 0.7;
                Complex32::new(z.re as f32, z.im as f32)
            })
            .collect();
        let mut buffers = [vec![Sample::ZERO; 1003], vec![Sample::ZERO; 1003]];
        let [a, b] = &mut buffers;
        let burst = Burst {
            waveform: &waveform,
            at_s: 1.0,
        };
        let received = radio.burst(&burst, [a, b]).unwrap();
        (received.clipped, buffers)
    };
    let (made, repeated) = (took(1e-300), took(0.0));
    assert!(made.0[0] > 100 && made.0[1] == 0, "{:?}", made.0);
    assert!(made == repeated);
}
