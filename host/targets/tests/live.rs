//! Places that are told while pulses come, against the truth and against those of the whole recording.

use num_complex::Complex32;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::Pulse;
use subaperture_motion::MotionError;
use subaperture_targets::live::{Live, Located};
use subaperture_targets::{Settings, TargetsError, recover};

use crate::scene::{Radar, Recording, l_band};
use crate::tracks::{off, off_by, reflectors, straight, walk, walked};

/// A recording, pulse by pulse of all channels.
fn pulses(recording: &Recording, radar: &Radar) -> Vec<Vec<(Pulse, Vec<Complex32>)>> {
    let all = recording.collections();
    let count = all[0].1.pulses.len();
    let pulse = |n: usize| {
        let each = all.iter();
        let one = each.map(|(_, collection, samples)| {
            let own = &samples[n * radar.samples..(n + 1) * radar.samples];
            (collection.pulses[n], own.to_vec())
        });
        one.collect()
    };
    (0..count).map(pulse).collect()
}

fn live(pulses: &[Vec<(Pulse, Vec<Complex32>)>], radar: &Radar) -> Result<Live, TargetsError> {
    let first: Vec<Pulse> = pulses[0].iter().map(|(pulse, _)| *pulse).collect();
    Live::new(&first, radar.samples, &Settings::default())
}

/// The walk of the whole recording's test, 20 m. What is told while it goes on is off by little more: each place is told by what came until ten pulses later, so that an error of the
/// targets' angles stays in the part of the way that it was made in; they are known to a degree or so after a metre, which is a part in fifty of it, and ten times better soon after.
#[test]
fn a_walk_is_found_while_it_goes_on() {
    let (radar, truth) = (l_band(), walk(801));
    let (told, all) = (straight(801), reflectors());
    let recording = walked(&radar, [&truth, &told], &all);
    let whole = recover(recording.channels(), &Settings::default(), &Silent).unwrap();
    let [whole_m, _] = off(&whole, &radar, &truth);
    let pulses = pulses(&recording, &radar);
    let mut live = live(&pulses, &radar).unwrap();
    let mut located: Vec<Located> = Vec::new();
    for (n, pulse) in pulses.iter().enumerate() {
        for place in live.push(pulse) {
            // A blind pulse makes all after it wait for one more.
            assert!(
                n <= place.pulse + live.lag() + live.going().blind,
                "{n}: {place:?}"
            );
            located.push(place);
        }
    }
    located.extend(live.finish());
    assert!(located.windows(2).all(|pair| pair[0].pulse < pair[1].pulse));
    let poses: Vec<_> = located
        .iter()
        .map(|place| (place.pulse, place.position_m, place.attitude))
        .collect();
    let [place_m, heading_rad] = off_by(&poses, &radar, &truth);
    let going = live.going();
    println!(
        "{} places {:.1} mm off, of the whole recording {:.1} mm; {:.3} deg; {going:?}",
        poses.len(),
        1e3 * place_m,
        1e3 * whole_m,
        heading_rad.to_degrees()
    );
    assert!(
        poses.len() + going.blind == 801 && going.blind < 40,
        "{going:?}"
    );
    assert!(place_m < 0.1, "{place_m}");
    // Measured: 1.1 degrees, RMS.
    assert!(heading_rad.to_degrees() < 1.5, "{heading_rad}");
    // The first place is where the recording begins, as it is turned there.
    let began = live.arrangement();
    assert!(located[0].position_m.distance(began.origin_m) < 1e-6);
    assert!(located[0].attitude.angle_between(began.attitude) < 1e-6);
}

/// Without echoes there are no places, and no end of memory; numbers that are none are as no echoes.
#[test]
fn where_nothing_is_seen_nothing_is_told() {
    let (radar, truth) = (l_band(), walk(60));
    let nothing = walked(&radar, [&truth, &truth], &[]);
    let mut pulses = pulses(&nothing, &radar);
    pulses[7][1].1[3].re = f32::NAN;
    let mut live = live(&pulses, &radar).unwrap();
    assert!(pulses.iter().all(|pulse| live.push(pulse).is_empty()));
    assert!(live.finish().is_empty());
    assert_eq!(live.going().blind, 60);
    // Receivers too far apart, and one alone.
    let mut wide = radar.clone();
    wide.receivers_m[1].x += 0.3;
    let wide_pulses = self::pulses(&walked(&wide, [&truth, &truth], &[]), &wide);
    let refused = self::live(&wide_pulses, &wide).err().unwrap();
    assert!(
        matches!(refused, TargetsError::Array(MotionError::Baseline { .. })),
        "{refused}"
    );
    wide.receivers_m.pop();
    let one = self::pulses(&walked(&wide, [&truth, &truth], &[]), &wide);
    let refused = self::live(&one, &wide).err().unwrap();
    assert!(
        matches!(refused, TargetsError::Array(MotionError::Antennas { .. })),
        "{refused}"
    );
}
