//! Cost of the core's processing stages, and of a sub-CPI through the endpoint: instructions on the emulated board under
//! `-icount shift=5`, cycles on a real one.
//!
//! Prints lines `name value` for the run, then `name length value` for single stages. Lines `loop ...` measure known
//! instruction counts, to verify the meter.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod odometer;
#[cfg(target_os = "none")]
mod profiles;
#[cfg(target_os = "none")]
mod random;
#[cfg(target_os = "none")]
mod run;

#[cfg(target_os = "none")]
mod target {
    use core::hint::black_box;

    use cortex_m_rt::entry;
    use num_complex::Complex;
    use subaperture_core::fixed_point::{self, sine};
    use subaperture_core::keystone::{chirp_z, sinc};
    use subaperture_core::{Complex32, Turns, fft, range};
    use subaperture_firmware::board::{Board, Current, end};
    use subaperture_firmware::meter::{Meter, UNIT, spin};
    use subaperture_firmware::place;
    use subaperture_firmware::sizes::RANGE_BINS;

    place!(axi static SAMPLES: [Complex32; 4096] = [Complex32::ZERO; 4096]);
    place!(axi static INTEGERS: [Complex<i32>; RANGE_BINS] = [Complex { re: 0, im: 0 }; RANGE_BINS]);

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            end(false);
        };
        let samples = SAMPLES.take();
        let meter = Meter::new(&board);
        // First, so that the stack high-water mark is that of the run.
        if super::run::run(&mut board, &meter).is_none() {
            board.log(format_args!("measurement failed: the run did not complete"));
            end(false);
        }
        board.log(format_args!("name length {UNIT}"));
        let show = |board: &mut Current, name: &str, length: usize, work: &mut dyn FnMut()| {
            let count = meter.measure(board, work).0;
            board.log(format_args!("{name} {length} {count}"));
        };
        for rounds in [1_000, 30_000] {
            show(&mut board, "loop", rounds as usize, &mut || spin(rounds));
        }
        for length in [64, 128, 256, 512, 1024, 2048, 4096] {
            let Some(buffer) = samples.get_mut(..length) else {
                end(false);
            };
            for (k, sample) in buffer.iter_mut().enumerate() {
                *sample = Turns(0x1234_5678_9abc_def1).times(k as i64).phasor();
            }
            show(&mut board, "fft", length, &mut || fft::forward(buffer));
        }
        let integers = INTEGERS.take();
        for (k, sample) in integers.iter_mut().enumerate() {
            // A quarter of a unit phasor: the magnitude of a row.
            let unit = sine::phasor(Turns(0x1234_5678_9abc_def1).times(k as i64));
            *sample = Complex::new(unit.re >> 2, unit.im >> 2);
        }
        show(&mut board, "fixed_fft", RANGE_BINS, &mut || {
            black_box(fixed_point::fft::inverse_bounded(integers, 28));
        });
        show(&mut board, "phasors", 1000, &mut || {
            let mut turns = Turns(0x1234_5678_9abc_def1);
            for _ in 0..1000 {
                black_box(turns.phasor());
                turns = turns.plus(Turns(0x0123_4567_89ab_cdef));
            }
        });
        let pulses: [Complex32; 32] =
            core::array::from_fn(|m| Turns(0x0fed_cba9_8765_4321).times(m as i64).phasor());
        let (scratch, rest) = samples.split_at_mut(3 * 128);
        let (column, rest) = rest.split_at_mut(64);
        let rate = chirp_z::rate(1.01, 64);
        show(&mut board, "keystone_chirp_z", 64, &mut || {
            chirp_z::transform(rate, &pulses, 64, scratch, column.iter_mut());
        });
        let mut matrix = [0.0; 32 * 32];
        sinc::fill_matrix(1.01, 32, &mut matrix);
        let (scratch, column) = scratch.split_at_mut(64);
        show(&mut board, "keystone_sinc", 64, &mut || {
            sinc::transform(&matrix, &pulses, scratch, column.iter_mut().take(64));
        });
        let row = rest.split_at_mut(128).0;
        show(&mut board, "range", 128, &mut || range::compress(row, 64));
        end(true)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
