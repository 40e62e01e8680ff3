//! Pulses in, maps out: whatever is pushed, a refused pulse changes nothing, to the bit.

use num_complex::Complex32;
use proptest::prelude::*;
use subaperture_core::{ChirpZSubCpi, Params, PushError, Status, Window};

const PULSES: usize = 5;
const FREQUENCIES: usize = 6;
type Owner = ChirpZSubCpi<PULSES, FREQUENCIES, 8, 8, 16>;

const PARAMS: Params<'static> = Params {
    start_hz: 1.0e9,
    step_hz: 1.0e6,
    fast_window: Window::Hamming,
    slow_window: Window::Taylor { side_lobe_db: 30.0 },
};

fn pulse(number: u32) -> [Complex32; FREQUENCIES] {
    std::array::from_fn(|k| Complex32::new(number as f32 + 0.1, k as f32 - 0.3))
}

fn bits(samples: &[Complex32]) -> Vec<(u32, u32)> {
    samples
        .iter()
        .map(|z| (z.re.to_bits(), z.im.to_bits()))
        .collect()
}

#[derive(Clone, Debug)]
enum Action {
    /// Number relative to the one due, and samples given.
    Push(i32, usize),
    Take,
    Restart(u32),
}

fn action() -> impl Strategy<Value = Action> {
    prop_oneof![
        8 => Just(Action::Push(0, FREQUENCIES)),
        2 => (-2..3, 0..9usize).prop_map(|(offset, length)| Action::Push(offset, length)),
        2 => Just(Action::Take),
        1 => prop_oneof![any::<u32>(), Just(u32::MAX - 2)].prop_map(Action::Restart),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn refused_pulses_leave_the_state_as_it_was(actions in prop::collection::vec(action(), 1..80)) {
        let mut owner = Owner::new();
        let mut processor = owner.start(&PARAMS).unwrap();
        // The model: how many pulses are in, and which is due.
        let (mut received, mut due) = (0usize, 0u32);
        for action in actions {
            match action {
                Action::Push(offset, length) => {
                    let number = due.wrapping_add_signed(offset);
                    let samples = vec![Complex32::new(f32::NAN, 1.0); length];
                    let good = pulse(number);
                    let samples = if length == FREQUENCIES { &good[..] } else { &samples[..] };
                    let before = (bits(processor.history()), processor.status(), processor.next_pulse());
                    let result = processor.push(number, samples);
                    if received == PULSES {
                        prop_assert_eq!(result, Err(PushError::Full));
                    } else if offset != 0 {
                        prop_assert_eq!(result, Err(PushError::Order { expected: due, got: number }));
                    } else if length != FREQUENCIES {
                        let expected = FREQUENCIES;
                        prop_assert_eq!(result, Err(PushError::Length { expected, got: length }));
                    } else {
                        received += 1;
                        due = due.wrapping_add(1);
                        let status = match PULSES - received {
                            0 => Status::Full,
                            missing => Status::Filling { missing },
                        };
                        prop_assert_eq!(result, Ok(status));
                    }
                    if result.is_err() {
                        let after = (bits(processor.history()), processor.status(), processor.next_pulse());
                        prop_assert_eq!(before, after);
                    }
                }
                Action::Take => {
                    prop_assert_eq!(processor.take_map().is_some(), received == PULSES);
                    received %= PULSES;
                }
                Action::Restart(next) => {
                    processor.restart(next);
                    (received, due) = (0, next);
                }
            }
            prop_assert_eq!(processor.next_pulse(), due);
        }
    }
}

/// A map does not depend on what came before it: not on refused pulses, dropped sub-CPIs, or the map
/// of another sub-CPI in the same buffers, even one of samples that are not numbers.
#[test]
fn maps_depend_on_their_own_pulses_only() {
    let mut clean = Owner::new();
    let mut clean = clean.start(&PARAMS).unwrap();
    clean.restart(100);
    for number in 100..105 {
        clean.push(number, &pulse(number)).unwrap();
    }
    let expected = bits(clean.take_map().unwrap().samples());

    let mut owner = Owner::new();
    let mut processor = owner.start(&PARAMS).unwrap();
    for number in 0..5 {
        let spoilt = [Complex32::new(f32::NAN, f32::INFINITY); FREQUENCIES];
        processor.push(number, &spoilt).unwrap();
    }
    assert_eq!(processor.push(5, &pulse(5)), Err(PushError::Full));
    assert!(processor.take_map().is_some());
    assert!(processor.take_map().is_none(), "a map is taken once");
    processor.push(5, &pulse(5)).unwrap(); // the count goes on
    let nothing = [Complex32::ZERO; FREQUENCIES];
    assert!(processor.push(7, &nothing).is_err());
    assert!(processor.take_map().is_none());
    processor.restart(100);
    for number in 100..105 {
        assert!(processor.push(number, &nothing[1..]).is_err());
        processor.push(number, &pulse(number)).unwrap();
    }
    assert_eq!(bits(processor.take_map().unwrap().samples()), expected);
}

#[test]
fn refusals_say_what_to_do() {
    let mut owner = Owner::new();
    let mut processor = owner.start(&PARAMS).unwrap();
    let order = processor.push(3, &pulse(3)).unwrap_err().to_string();
    assert_eq!(
        order,
        "pulse 3 came where 0 is due; restart to go on from it"
    );
    let length = processor.push(0, &[]).unwrap_err().to_string();
    assert_eq!(length, "a pulse has 6 samples, not 0");
}
