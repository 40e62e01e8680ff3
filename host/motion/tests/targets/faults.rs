//! Faults of recordings: reports, refusals, and tracks from the remaining data.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec2;
use num_complex::{Complex32, Complex64};
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{
    Channel, Channels, Collection, InMemory, PhaseHistory, ReadError,
};
use subaperture_motion::targets::{Fault, Recovered, Settings, TargetsError, recover};

use crate::scene::{C_M_S, Radar, Recording, Reflector, channels, l_band};
use crate::tracks::{off, reflectors, straight, walk};

/// Pulses of a recording: the first 3 m of the walk.
const PULSES: usize = 120;

type Recorded = Vec<(Channel, Collection, Vec<Complex32>)>;

fn recorded(radar: &Radar, reflectors: &[Reflector], noise: f64) -> Recorded {
    Recording {
        radar,
        truth: &walk(PULSES),
        recorded: &straight(PULSES),
        reflectors,
        noise,
        seed: 3,
    }
    .collections()
}

fn found(channels: Channels) -> Result<Recovered, TargetsError> {
    recover(channels, &Settings::default(), &Silent)
}

/// Radar with a third receiver.
fn three() -> Radar {
    let mut radar = l_band();
    radar.receivers_m.push(DVec2::new(0.41, 0.0));
    radar
}

const NOISE: f64 = 0.4;

#[test]
fn recordings_with_no_or_one_target_are_refused() {
    let radar = l_band();
    let no_target = found(channels(recorded(&radar, &[], NOISE))).unwrap_err();
    assert!(
        matches!(no_target, TargetsError::NoLastingTarget { pulses: PULSES, most_db } if most_db < 3.0),
        "{no_target}"
    );
    let one = found(channels(recorded(&radar, &reflectors()[..1], NOISE))).unwrap_err();
    // The target is at 8.1 to 8.6 m.
    assert!(
        matches!(one, TargetsError::TooFew { most: 1, ranges_m: (near, far), .. } if near > 7.0 && far < 9.5),
        "{one}"
    );
    assert!(one.to_string().contains("ranges are reliable"), "{one}");
}

#[test]
fn dead_channels_are_omitted_while_two_receivers_remain() {
    let mut all = recorded(&three(), &reflectors(), NOISE);
    let truth = walk(PULSES);
    let mut apart = all.clone();
    apart[1].2.fill(Complex32::ZERO);
    let error = found(channels(apart)).unwrap_err().to_string();
    assert!(
        error.contains("2 of 3 channels have echoes (dead: T1R2)"),
        "{error}"
    );
    all[2].2.fill(Complex32::ZERO);
    let track = found(channels(all.clone())).unwrap();
    let is_dead = |fault: &&Fault| matches!(fault, Fault::Dead { channel, below_db: None } if channel == "T1R3");
    let faults = &track.seen.faults;
    assert_eq!(faults.iter().filter(is_dead).count(), 1, "{faults:?}");
    assert_eq!(track.seen.channels, ["T1R1", "T1R2"]);
    // Noise without echoes: a disconnected cable.
    let mut noisy = recorded(&three(), &reflectors(), NOISE);
    noisy[2].2 = recorded(&three(), &[], NOISE).remove(2).2;
    let track = found(channels(noisy)).unwrap();
    let dead = track
        .seen
        .faults
        .iter()
        .find(|fault| matches!(fault, Fault::Dead { .. }));
    assert!(dead.unwrap().to_string().contains("T1R3"), "{dead:?}");
    let [place_m, _] = off(&track, &l_band(), &truth);
    println!("with the third receiver dead {:.1} mm", 1e3 * place_m);
    assert!(place_m < 0.01, "{place_m}");

    all[1].2.fill(Complex32::ZERO);
    let one = found(channels(all.clone())).unwrap_err().to_string();
    assert!(
        one.contains("1 of 3 channels") && one.contains("T1R2, T1R3"),
        "{one}"
    );
    all[0].2.fill(Complex32::ZERO);
    let none = found(channels(all)).unwrap_err();
    assert!(matches!(none, TargetsError::AllDead), "{none}");
}

/// Samples clipped by the converter at the fraction `part` of the largest value, before the recording's compensation.
fn clipped(
    (about, collection, mut samples): (Channel, Collection, Vec<Complex32>),
    part: f32,
) -> (Channel, Collection, Vec<Complex32>) {
    let width = collection.num_samples;
    let turn = |i: usize| {
        let pulse = &collection.pulses[i / width];
        let turns = pulse.frequency_hz(i % width) * pulse.reference_path_m / C_M_S;
        Complex64::cis(TAU * turns.fract())
    };
    let wide = |z: &Complex32| Complex64::new(z.re.into(), z.im.into());
    let raw: Vec<Complex64> = samples
        .iter()
        .enumerate()
        .map(|(i, z)| wide(z) * turn(i).conj())
        .collect();
    let most = f64::from(part)
        * raw
            .iter()
            .fold(0.0f64, |most, z| most.max(z.re.abs()).max(z.im.abs()));
    for (i, sample) in samples.iter_mut().enumerate() {
        let held =
            Complex64::new(raw[i].re.clamp(-most, most), raw[i].im.clamp(-most, most)) * turn(i);
        *sample = Complex32::new(held.re as f32, held.im as f32);
    }
    (about, collection, samples)
}

#[test]
fn saturated_channel_is_reported() {
    let mut all = recorded(&l_band(), &reflectors(), NOISE);
    let sound = found(channels(all.clone())).unwrap();
    assert!(
        !sound
            .seen
            .faults
            .iter()
            .any(|fault| matches!(fault, Fault::Saturated { .. }))
    );
    let first = clipped(all.remove(0), 0.5);
    all.insert(0, first);
    let track = found(channels(all)).unwrap();
    let saturated: Vec<&Fault> = track
        .seen
        .faults
        .iter()
        .filter(|fault| matches!(fault, Fault::Saturated { .. }))
        .collect();
    let [Fault::Saturated { channel, share }] = saturated[..] else {
        panic!("{:?}", track.seen.faults);
    };
    assert!(channel == "T1R1" && *share > 0.02, "{channel} {share}");
}

/// Recording with non-finite samples in some pulses.
struct Damaged {
    whole: InMemory,
    pulses: Vec<usize>,
}

impl PhaseHistory for Damaged {
    fn collection(&self) -> &Collection {
        self.whole.collection()
    }

    fn read(&self, run: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.whole.read(run.clone(), samples)?;
        let width = self.collection().num_samples;
        for &pulse in self.pulses.iter().filter(|pulse| run.contains(*pulse)) {
            samples[(pulse - run.start) * width + 7].im = f32::NAN;
        }
        Ok(())
    }
}

#[test]
fn pulses_with_non_finite_samples_are_omitted() {
    let all = recorded(&l_band(), &reflectors(), NOISE);
    let damaged = all.into_iter().map(|(about, collection, samples)| {
        let whole = InMemory::new(collection, samples).unwrap();
        let pulses = vec![40, 41, 77];
        let history: Box<dyn PhaseHistory> = Box::new(Damaged { whole, pulses });
        (about, history)
    });
    let track = found(Channels::new(damaged.collect()).unwrap()).unwrap();
    let unreadable = track.seen.faults.iter().find_map(|fault| match fault {
        Fault::Unreadable {
            pulses,
            first,
            reason,
        } => Some((*pulses, *first, reason.clone())),
        _ => None,
    });
    let (pulses, first, reason) = unreadable.unwrap();
    assert_eq!((pulses, first), (3, 40));
    assert!(reason.contains("sample 7 of pulse 40"), "{reason}");
    let have: Vec<usize> = track.moments.iter().map(|moment| moment.pulse).collect();
    let without: Vec<usize> = (0..PULSES).filter(|n| ![40, 41, 77].contains(n)).collect();
    assert_eq!(have, without);
    let [place_m, _] = off(&track, &l_band(), &walk(PULSES));
    assert!(place_m < 0.01, "{place_m}");
}

#[test]
fn swapped_receivers_are_reported() {
    let mut all = recorded(&l_band(), &reflectors(), NOISE);
    let other = all[1].2.clone();
    all[1].2 = std::mem::replace(&mut all[0].2, other);
    // The reference paths of the compensation belong to the samples.
    let paths: Vec<Vec<f64>> = all
        .iter()
        .map(|(_, collection, _)| {
            collection
                .pulses
                .iter()
                .map(|pulse| pulse.reference_path_m)
                .collect()
        })
        .collect();
    for (c, (_, collection, _)) in all.iter_mut().enumerate() {
        for (pulse, path_m) in collection.pulses.iter_mut().zip(&paths[1 - c]) {
            pulse.reference_path_m = *path_m;
        }
    }
    let track = found(channels(all)).unwrap();
    assert!(
        track.seen.faults.contains(&Fault::Reversed),
        "{:?}",
        track.seen.faults
    );
}

#[test]
fn invalid_settings_and_recordings_are_refused() {
    let all = recorded(&l_band(), &reflectors()[..2], NOISE);
    let refused = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        recover(channels(all.clone()), &settings, &Silent)
            .unwrap_err()
            .to_string()
    };
    assert!(refused(|s| s.ranges_m = Some((5.0, f64::NAN))).contains("ranges"));
    assert!(refused(|s| s.least_snr_db = f64::INFINITY).contains("SNR"));
    assert!(refused(|s| s.cfar.training = 0).contains("training"));
    assert!(refused(|s| s.follow.seen = 0).contains("candidate"));
    assert!(refused(|s| s.follow.gate_cells = f64::NAN).contains("gate"));

    let mut other = all.clone();
    for pulse in &mut other[1].1.pulses {
        pulse.start_hz += 1e6;
    }
    let error = found(channels(other)).unwrap_err();
    assert!(matches!(error, TargetsError::Band), "{error}");
    let alone = found(channels(all[..1].to_vec())).unwrap_err().to_string();
    assert!(alone.contains("two receivers"), "{alone}");

    struct Stopped;
    impl Monitor for Stopped {
        fn progress(&self, _: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let stopped = recover(channels(all), &Settings::default(), &Stopped);
    assert!(matches!(stopped, Err(TargetsError::Cancelled)));
}
