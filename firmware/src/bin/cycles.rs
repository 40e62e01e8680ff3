//! What stages of the core cost: a table `name instructions` on the emulated board, cycles on a real one.
//!
//! The emulator has no cycle counter. Under `-icount shift=5` it lets 32 ns pass with each instruction, and the
//! board's timer counts them at 25 MHz: 1.25 ticks an instruction. The program does not rely on
//! that: it first times a loop of instructions that it knows (`per unit` below), and turns ticks into
//! instructions by it. Without `-icount` ticks are the host's time and the table means nothing; the lines
//! `loop ...`, of known counts, show it. Interrupts are none, so that two runs agree.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use core::arch::asm;
    use core::hint::black_box;

    use cortex_m_rt::entry;
    use subaperture_core::keystone::{chirp_z, sinc};
    use subaperture_core::{Complex32, Turns, fft, range};
    use subaperture_firmware::board::{Board, Current, end};
    use subaperture_firmware::place;

    place!(axi static SAMPLES: [Complex32; 4096] = [Complex32::ZERO; 4096]);

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            end(false);
        };
        let samples = SAMPLES.take();
        let mut meter = Meter::new(&board);
        let unit = if cfg!(feature = "board-an500") {
            "instructions"
        } else {
            "cycles"
        };
        board.log(format_args!("name {unit}"));
        let mut show = |board: &mut Current, name: &str, length: usize, work: &mut dyn FnMut()| {
            let count = meter.measure(board, work);
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

    /// `2 rounds` instructions and those of a call.
    #[inline(never)]
    fn spin(rounds: u32) {
        // SAFETY: counts a register down; touches no memory.
        unsafe {
            asm!("2: subs {0}, {0}, #1", "bne 2b", inout(reg) rounds => _, options(nomem, nostack));
        }
    }

    /// Ticks to instructions (cycles, where the counter counts them).
    struct Meter {
        known_instructions: u64,
        known_ticks: u64,
        empty_ticks: u32,
    }

    impl Meter {
        fn new(board: &Current) -> Self {
            let mut meter = Self {
                known_instructions: 1,
                known_ticks: 1,
                empty_ticks: 0,
            };
            meter.empty_ticks = meter.ticks(board, &mut || ());
            if cfg!(feature = "board-an500") {
                let rounds = 1_000_000;
                meter.known_ticks = u64::from(meter.ticks(board, &mut || spin(rounds)).max(1));
                meter.known_instructions = 2 * u64::from(rounds);
            }
            meter
        }

        fn ticks(&self, board: &Current, work: &mut dyn FnMut()) -> u32 {
            let start = board.ticks();
            work();
            let ticks = board.ticks().wrapping_sub(start);
            ticks.saturating_sub(self.empty_ticks)
        }

        fn measure(&mut self, board: &Current, work: &mut dyn FnMut()) -> u64 {
            u64::from(self.ticks(board, work)) * self.known_instructions / self.known_ticks.max(1)
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program is for a board");
}
