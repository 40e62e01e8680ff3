//! The stream processor under any order of pushes and work: a sub-CPI whose pulses were all accepted gives its map once,
//! bit-identical whatever came before and in between; no other sub-CPI does; every pulse is counted.

use proptest::prelude::*;
use subaperture_core::fixed_point::FixedSlices;
use subaperture_core::stream::{
    Capacity, FixedBuffers, FixedEngine, FloatBuffers, FloatEngine, Patch, Progress, PulseError,
    PulsePhase, Setup, Store, SubCpiProcessor,
};
use subaperture_core::{Complex32, LengthError, Pulse, Sc16, fixed_point};
use subaperture_tests::stream_scene::{at, patch};

const PULSES: u32 = 3;
const FREQUENCIES: u32 = 4;
type Buffers = FloatBuffers<3, 4, 4, 3, 1>;
type Processor<'a> = SubCpiProcessor<'a, FloatEngine<'a>>;

const SETUP: Setup = Setup {
    num_pulses: PULSES as u16,
    num_channels: 1,
    num_frequencies: FREQUENCIES as u16,
    range_length: 4,
    doppler_length: 3,
    start_hz: 1.0e9,
    step_hz: 1.0e6,
};

#[derive(Clone, Copy, Debug)]
enum Action {
    /// The expected pulse.
    Push,
    /// A pulse after this many lost ones.
    Skip(u32),
    /// A repeated or late pulse.
    Late(u32),
    /// A pulse with a wrong number of samples.
    Length(u32),
    /// A pulse with a sample or position that is not finite.
    NotFinite(bool),
    /// This many calls of `work`.
    Work(usize),
}

fn action() -> impl Strategy<Value = Action> {
    prop_oneof![
        24 => Just(Action::Push),
        1 => (1..8u32).prop_map(Action::Skip),
        1 => (1..8u32).prop_map(Action::Late),
        1 => prop_oneof![0..FREQUENCIES, 5..9u32].prop_map(Action::Length),
        1 => any::<bool>().prop_map(Action::NotFinite),
        8 => (1..20usize).prop_map(Action::Work),
    ]
}

fn pulse(number: u32) -> Pulse {
    Pulse {
        number,
        transmitter_m: [f64::from(number) * 0.3, -50.0, 20.0],
        weight: 1.0 / (1 + number % 5) as f32,
        ..Pulse::EMPTY
    }
}

fn sample(number: u32, k: u32) -> Complex32 {
    Complex32::new(number as f32 + 0.1, k as f32 - 0.3)
}

fn start(buffers: &mut Buffers, first: u32) -> Processor<'_> {
    let mut processor = buffers.processor();
    processor.configure(&SETUP).unwrap();
    processor.set_patch(0, &patch([1.0; 3], 1, 1)).unwrap();
    processor.start(first).unwrap();
    processor
}

/// Sub-CPI number and bits of the map.
type Made = (u32, Vec<[u32; 2]>);

/// One call of `work`. Collects the map if it completes one.
fn work(processor: &mut Processor<'_>, maps: &mut Vec<Made>) -> Progress {
    let progress = processor.work();
    if progress == Progress::Map {
        let map = processor.map().unwrap();
        let bits = |z: &Complex32| [z.re.to_bits(), z.im.to_bits()];
        maps.push((map.header.sub_cpi, at(&map).iter().map(bits).collect()));
    }
    progress
}

/// Map of a sub-CPI by itself, in separate buffers.
fn alone(sub_cpi: u32) -> Made {
    let mut buffers = Buffers::new();
    let first = sub_cpi * PULSES;
    let mut processor = start(&mut buffers, first);
    for number in first..first + PULSES {
        let samples = (0..FREQUENCIES).map(|k| sample(number, k));
        processor.push(&pulse(number), samples).unwrap();
    }
    let mut maps = Vec::new();
    while work(&mut processor, &mut maps) != Progress::Idle {}
    assert_eq!(maps.len(), 1);
    maps.remove(0)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn only_complete_sub_cpis_give_maps(
        actions in prop::collection::vec(action(), 1..120)
    ) {
        let mut buffers = Buffers::new();
        let mut processor = start(&mut buffers, 0);
        let (mut taken, mut maps) = (Vec::new(), Vec::new());
        let (mut pushes, mut lost) = (0, 0);
        for action in actions {
            let due = processor.next_pulse();
            let (mut one, mut count, mut spoilt) = (pulse(due), FREQUENCIES, false);
            match action {
                Action::Push => {}
                Action::Skip(missing) => {
                    one = pulse(due + missing);
                    lost += missing;
                }
                Action::Late(by) => one = pulse(due.saturating_sub(by)),
                Action::Length(other) => count = other,
                Action::NotFinite(true) => spoilt = true,
                Action::NotFinite(false) => one.receiver_m[1] = f64::NAN,
                Action::Work(pieces) => {
                    for _ in 0..pieces {
                        work(&mut processor, &mut maps);
                    }
                    continue;
                }
            }
            pushes += 1;
            let samples = (0..count).map(|k| match spoilt && k == 2 {
                true => Complex32::new(f32::NAN, 0.0),
                false => sample(one.number, k),
            });
            let good = count == FREQUENCIES && !spoilt && one.receiver_m[1].is_finite();
            let result = processor.push(&one, samples);
            prop_assert!(result.is_err() || (good && one.number >= due), "{:?}", action);
            if result.is_ok() {
                taken.push(one.number);
            }
            prop_assert_eq!(processor.next_pulse(), due.max(one.number + 1));
        }
        while work(&mut processor, &mut maps) != Progress::Idle {}

        let expected: Vec<Made> = (0..=processor.next_pulse() / PULSES)
            .filter(|n| (n * PULSES..(n + 1) * PULSES).all(|number| taken.contains(&number)))
            .map(alone)
            .collect();
        prop_assert_eq!(maps, expected);
        let counters = processor.counters();
        prop_assert_eq!(counters.accepted, taken.len() as u32);
        prop_assert_eq!(counters.lost, lost);
        let others = counters.repeated + counters.refused + counters.dropped;
        prop_assert_eq!(counters.accepted + others, pushes);
    }
}

/// Push a valid pulse.
fn push(processor: &mut Processor<'_>, number: u32) -> Result<(), PulseError> {
    let samples = (0..FREQUENCIES).map(|k| sample(number, k));
    processor.push(&pulse(number), samples)
}

#[test]
fn partial_sub_cpi_with_missing_pulse_is_discarded() {
    // A rest without gaps: two pulses of three.
    let mut buffers = Buffers::new();
    let mut processor = start(&mut buffers, 0);
    for number in 0..2 {
        push(&mut processor, number).unwrap();
    }
    processor.finish();
    let mut maps = Vec::new();
    while work(&mut processor, &mut maps) != Progress::Idle {}
    assert_eq!(maps.len(), 1);
    // The third pulse arrived, but too short.
    processor.start(0).unwrap();
    for number in 0..2 {
        push(&mut processor, number).unwrap();
    }
    let short = processor.push(&pulse(2), [Complex32::ONE].into_iter());
    assert_eq!(short, Err(PulseError::Length));
    processor.finish();
    assert_eq!(work(&mut processor, &mut maps), Progress::Idle);
    assert_eq!((maps.len(), processor.counters().incomplete), (1, 1));
}

#[test]
fn partial_sub_cpi_waits_for_full_store() {
    let mut buffers = Buffers::new();
    let mut processor = start(&mut buffers, 0);
    for number in 0..5 {
        push(&mut processor, number).unwrap();
    }
    let mut maps = Vec::new();
    work(&mut processor, &mut maps);
    processor.finish();
    processor.finish();
    assert_eq!(push(&mut processor, 5), Err(PulseError::NotRunning));
    while work(&mut processor, &mut maps) != Progress::Idle {}
    let numbers: Vec<u32> = maps.iter().map(|map| map.0).collect();
    assert_eq!(numbers, [0, 1]);
    assert!(!processor.is_working());
}

/// The largest number would be followed by itself and count as new forever.
#[test]
fn largest_pulse_number_is_rejected() {
    let first = u32::MAX / PULSES * PULSES;
    let mut buffers = Buffers::new();
    let mut processor = start(&mut buffers, first - PULSES);
    for number in first - PULSES..first {
        push(&mut processor, number).unwrap();
    }
    for _ in 0..2 {
        assert_eq!(push(&mut processor, u32::MAX), Err(PulseError::Number));
    }
    let counters = processor.counters();
    assert_eq!((counters.refused, counters.lost), (2, 0));
    assert_eq!(processor.next_pulse(), first);
    let mut maps = Vec::new();
    while work(&mut processor, &mut maps) != Progress::Idle {}
    assert_eq!(maps, [alone(first / PULSES - 1)]);
}

#[test]
fn bin_far_outside_map_is_zero() {
    let mut buffers = Buffers::new();
    let mut processor = start(&mut buffers, 0);
    for number in 0..PULSES {
        push(&mut processor, number).unwrap();
    }
    while processor.work() != Progress::Map {}
    let map = processor.map().unwrap();
    assert_ne!(map.at(1, 1), Complex32::ZERO);
    for far in [2, -2, i32::MAX, i32::MIN] {
        assert_eq!(map.at(far, 0), Complex32::ZERO, "{far}");
        assert_eq!(map.at(0, far), Complex32::ZERO, "{far}");
    }
}

/// Weights so large that mantissas are clamped, in one run of two.
#[test]
fn saturated_results_are_counted_per_run() {
    let mut buffers = FixedBuffers::<3, 4, 4, 3, 2, 1>::new();
    let mut processor = buffers.processor().unwrap();
    processor.configure(&SETUP).unwrap();
    processor.set_patch(0, &patch([1.0; 3], 1, 1)).unwrap();
    let mut run = |weight: f32| {
        processor.start(0).unwrap();
        for number in 0..PULSES {
            let pulse = Pulse {
                weight,
                ..pulse(number)
            };
            let samples = [Sc16::from_bits(20_000, -20_000); FREQUENCIES as usize];
            processor.push(&pulse, samples.into_iter()).unwrap();
        }
        while processor.work() != Progress::Idle {}
        processor.counters().saturated
    };
    assert_eq!(run(1.0), 0);
    let clamped = run(f32::MAX);
    assert!(clamped > 0);
    assert_eq!(run(1.0), 0);
    assert_eq!(run(f32::MAX), clamped);
}

/// Every buffer in turn is one element too short for a capacity of 3 pulses, 4 frequencies, 4 range bins, 3 Doppler bins and 1
/// patch: pulses could not be stored completely, so the processor is not created.
#[test]
fn from_parts_rejects_each_short_buffer() {
    let capacity = Capacity {
        pulses: 3,
        frequencies: 4,
        range_bins: 4,
        doppler_bins: 3,
        patches: 1,
    };
    let sizes = [4, 1, 12, 3, 12, 3, 12, 4, 3, 3];
    let names = [
        "weights",
        "patches",
        "pulse store samples",
        "pulse store headers",
        "pulse store samples",
        "pulse store headers",
        "map",
        "range row",
        "column",
        "pulse phases",
    ];
    let lend = |sizes: [usize; 10], capacity: Capacity| {
        let zeros = |i: usize| vec![Complex32::ZERO; sizes[i]];
        let pulses = |i: usize| vec![Pulse::EMPTY; sizes[i]];
        let (mut weights, mut patches) = (vec![0.0; sizes[0]], vec![Patch::EMPTY; sizes[1]]);
        let (mut a, mut first, mut b, mut second) = (zeros(2), pulses(3), zeros(4), pulses(5));
        let (mut map, mut row, mut column) = (zeros(6), zeros(7), zeros(8));
        let mut phases = vec![PulsePhase::EMPTY; sizes[9]];
        let engine = FloatEngine::new(&mut map, &mut row, &mut column, &mut phases);
        let stores = [
            Store::new(&mut a, &mut first),
            Store::new(&mut b, &mut second),
        ];
        SubCpiProcessor::from_parts(engine, capacity, &mut weights, &mut patches, stores).map(
            |mut processor| {
                processor.configure(&SETUP).unwrap();
                processor.set_patch(0, &patch([1.0; 3], 1, 1)).unwrap();
                processor.start(0).unwrap();
                for number in 0..PULSES {
                    let samples = (0..FREQUENCIES).map(|k| sample(number, k));
                    processor.push(&pulse(number), samples).unwrap();
                }
                while processor.work() == Progress::Busy {}
                at(&processor.map().unwrap())
            },
        )
    };
    // Bit-identical to a processor on arrays.
    let mut buffers = Buffers::new();
    let mut processor = start(&mut buffers, 0);
    for number in 0..PULSES {
        let samples = (0..FREQUENCIES).map(|k| sample(number, k));
        processor.push(&pulse(number), samples).unwrap();
    }
    while processor.work() == Progress::Busy {}
    assert_eq!(lend(sizes, capacity), Ok(at(&processor.map().unwrap())));
    for (i, what) in names.into_iter().enumerate() {
        let mut short = sizes;
        short[i] -= 1;
        let error = LengthError {
            what,
            expected: sizes[i],
            got: short[i],
        };
        assert_eq!(lend(short, capacity), Err(error), "{i}");
    }
}

/// An engine made for a smaller capacity than the processor states.
#[test]
fn from_parts_rejects_engine_smaller_than_capacity() {
    let mut memory = FixedBuffers::<3, 4, 4, 3, 2, 1>::new();
    let small = *memory.processor().unwrap().capacity();
    let capacity = Capacity {
        doppler_bins: 5,
        range_bins: 8,
        ..small
    };
    let zero = num_complex::Complex { re: 0, im: 0 };
    let slices = FixedSlices {
        cells: &mut vec![Sc16::ZERO; FixedSlices::cells_len(&small)],
        column_exponents: &mut vec![0; FixedSlices::column_exponents_len(&small)],
        row_exponents: &mut vec![0; FixedSlices::row_exponents_len(&small)],
        work: &mut vec![zero; FixedSlices::work_len(&small)],
        phases: &mut [fixed_point::PulsePhase::EMPTY; 3],
        folded: &mut [zero; 3],
    };
    let engine = FixedEngine::new(slices, &small).unwrap();
    let (mut weights, mut patches) = ([0.0; 4], [Patch::EMPTY; 1]);
    let (mut a, mut b) = ([Sc16::ZERO; 12], [Sc16::ZERO; 12]);
    let (mut first, mut second) = ([Pulse::EMPTY; 3], [Pulse::EMPTY; 3]);
    let stores = [
        Store::new(&mut a, &mut first),
        Store::new(&mut b, &mut second),
    ];
    let lent = SubCpiProcessor::from_parts(engine, capacity, &mut weights, &mut patches, stores);
    let error = LengthError {
        what: "cells",
        expected: 20,
        got: 12,
    };
    assert_eq!(lent.err(), Some(error));
}
