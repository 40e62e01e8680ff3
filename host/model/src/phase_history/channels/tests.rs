//! Selection and combination of channels.

use super::*;
use crate::geometry::SceneFrame;
use crate::phase_history::{Collection, InMemory, Pulse, Sweep, Weights};
use glam::DVec3;
use num_complex::Complex32;
use subaperture_signal::window::Window;

/// Pulses 1 ms apart, `late_s` after the start of the turn, of a receiver `apart_m` from the transmitter. Samples
/// encode channel and pulse.
fn channel(name: &str, count: usize, late_s: f64, apart_m: f64) -> ChannelHistory<'static> {
    let pulse = |n: usize| Pulse {
        time_s: n as f64 * 1e-3 + late_s,
        transmitter_m: DVec3::new(n as f64, -5e3, 0.0),
        receiver_m: DVec3::new(n as f64 + apart_m, -5e3, 0.0),
        reference_m: DVec3::ZERO,
        reference_path_m: 1e4,
        start_hz: 10e9,
        step_hz: 1e6,
        sweep: Sweep::AT_ONCE,
        recorded_path_m: None,
    };
    let collection = Collection {
        name: format!("pass channel {name}"),
        num_samples: 2,
        pulses: (0..count).map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let sample = |i: usize| Complex32::new(i as f32, apart_m as f32);
    let samples = (0..2 * count).map(sample).collect();
    let history = InMemory::new(collection, samples).unwrap();
    (Channel::new(name), Box::new(history))
}

fn refused(channels: Vec<ChannelHistory<'static>>) -> ChannelError {
    Channels::new(channels).err().unwrap()
}

#[test]
fn channels_share_their_pulses_or_are_refused() {
    let pair = || vec![channel("a", 4, 0.0, 0.0), channel("b", 4, 5e-4, 1.0)];
    let channels = Channels::new(pair()).unwrap();
    assert_eq!((channels.len(), channels.num_pulses()), (2, 4));
    let names = || ["a".to_owned(), "b".to_owned()];
    let fewer = vec![channel("a", 4, 0.0, 0.0), channel("b", 3, 0.0, 1.0)];
    let counts = [4, 3];
    let names_of = names();
    assert_eq!(
        refused(fewer),
        ChannelError::Pulses {
            names: names_of,
            counts
        }
    );
    // Later than the start of the next turn.
    let late = vec![channel("a", 4, 0.0, 0.0), channel("b", 4, 1.5e-3, 1.0)];
    assert_eq!(
        refused(late),
        ChannelError::Moments {
            names: ["b".to_owned(), "a".to_owned()],
            pulse: 0,
            times_s: [1.5e-3, 1e-3],
        }
    );
    let twice = vec![channel("a", 4, 0.0, 0.0), channel("a", 4, 0.0, 1.0)];
    let name = "a".to_owned();
    assert_eq!(refused(twice), ChannelError::Twice { name });
    assert_eq!(refused(Vec::new()), ChannelError::None);
    let untimed = |mut pair: Vec<ChannelHistory<'static>>| {
        let mut collection = pair[1].1.collection().clone();
        collection.timed = false;
        let samples = vec![Complex32::ONE; 8];
        pair[1].1 = Box::new(InMemory::new(collection, samples).unwrap());
        refused(pair)
    };
    assert_eq!(untimed(pair()), ChannelError::Untimed { names: names() });
}

#[test]
fn channels_are_selected_by_name_or_number() {
    let named = |names: [&str; 3]| {
        let channels = names.map(|name| channel(name, 2, 0.0, name.len() as f64));
        Channels::new(channels.into()).unwrap()
    };
    let letters = named(["a", "bb", "ccc"]);
    assert_eq!(letters.find("bb"), Ok(1));
    assert_eq!(letters.find("3"), Ok(2));
    for wanted in ["0", "4", "d"] {
        let error = letters.find(wanted).unwrap_err().to_string();
        assert_eq!(
            error,
            format!("unknown channel '{wanted}': expected one of: a, bb, ccc")
        );
    }
    // If names are numbers, a number is a name.
    let numbers = named(["7", "22", "111"]);
    assert_eq!(numbers.find("22"), Ok(1));
    assert!(numbers.find("1").is_err());
    let chosen = named(["a", "bb", "ccc"]).select(&["ccc", "1"]).unwrap();
    let names: Vec<&str> = chosen.about().map(|about| about.name.as_str()).collect();
    assert_eq!(names, ["ccc", "a"]);
    let twice = named(["a", "bb", "ccc"]).select(&["a", "1"]).err().unwrap();
    assert_eq!(
        twice,
        ChannelError::Twice {
            name: "a".to_owned()
        }
    );
}

#[test]
fn coherent_sum_has_all_pulses_with_equal_weights() {
    let three = || (0..3).map(|c| channel(["a", "b", "c"][c], 5, c as f64 * 2e-4, c as f64));
    let sum = Channels::new(three().collect())
        .unwrap()
        .coherent_sum()
        .unwrap();
    let collection = sum.collection();
    assert_eq!(collection.name, "pass channels a, b, c");
    assert_eq!((collection.pulses.len(), collection.num_turns()), (15, 5));
    for from in 0..15 {
        for to in from..=15 {
            let mut got = vec![Complex32::ZERO; 2 * (to - from)];
            sum.read(from..to, &mut got).unwrap();
            let expected =
                (2 * from..2 * to).map(|i| Complex32::new((i % 10) as f32, (i / 10) as f32));
            assert_eq!(got, expected.collect::<Vec<_>>(), "{from}..{to}");
        }
    }
    let weights = Weights::new(collection, Window::None, Window::Hamming);
    // Hamming weights of five pulses.
    let own =
        [-0.4, -0.2, 0.0, 0.2, 0.4].map(|u: f64| 0.54 + 0.46 * (std::f64::consts::TAU * u).cos());
    for (n, weight) in weights.slow.iter().enumerate() {
        assert!((weight - own[n % 5]).abs() < 1e-12, "{n}: {weight}");
    }
    // Sorted by time they are one turn.
    let mut in_time = collection.clone();
    in_time.pulses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    assert_eq!(in_time.num_turns(), 15);
}

#[test]
fn incompatible_channels_are_not_summed() {
    let sum = |channels: Vec<ChannelHistory<'static>>| {
        let error = Channels::new(channels).unwrap().coherent_sum().err();
        error.unwrap()
    };
    let polarized = |letters: [&str; 2], (about, history): ChannelHistory<'static>| {
        let [transmitted, received] = letters.map(|letter| Some(letter.to_owned()));
        (about.polarized(transmitted, received), history)
    };
    let names = || ["a".to_owned(), "b".to_owned()];
    let [a, b] = [channel("a", 3, 0.0, 0.0), channel("b", 3, 0.0, 1.0)];
    let error = sum(vec![polarized(["H", "H"], a), polarized(["H", "V"], b)]);
    assert_eq!(
        error,
        ChannelError::Polarizations {
            names: names(),
            polarizations: ["HH".to_owned(), "HV".to_owned()],
        }
    );
    // Same antennas at the same time, as with polarisations that are not named.
    let same = vec![channel("a", 3, 0.0, 1.0), channel("b", 3, 0.0, 1.0)];
    assert_eq!(sum(same), ChannelError::SameLooks { names: names() });
    let (about, history) = channel("b", 3, 0.0, 1.0);
    let mut wider = history.collection().clone();
    wider.num_samples = 3;
    let wider = InMemory::new(wider, vec![Complex32::ONE; 9]).unwrap();
    let error = sum(vec![channel("a", 3, 0.0, 0.0), (about, Box::new(wider))]);
    let counts = [2, 3];
    assert_eq!(
        error,
        ChannelError::Samples {
            names: names(),
            counts
        }
    );
}
