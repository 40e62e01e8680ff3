//! Common code of the fuzzing programs: each reads the fuzzer's input by one of [`subaperture_tests::fuzz::TARGETS`], and repairs most of
//! it first.

pub use libfuzzer_sys;
pub use subaperture_tests;

/// Program of the target with this name.
#[macro_export]
macro_rules! program {
    ($name:literal) => {
        use $crate::libfuzzer_sys::{self, fuzz_mutator, fuzz_target, fuzzer_mutate};

        fuzz_target!(|bytes: &[u8]| {
            ($crate::subaperture_tests::fuzz::target($name).read)(bytes);
        });

        fuzz_mutator!(
            |bytes: &mut [u8], size: usize, max_size: usize, seed: u32| {
                $crate::mutated($name, bytes, size, max_size, seed)
            }
        );
    };
}

/// Change an input by the fuzzer or by this project's own mutator, and three times in four correct lengths and checksums; returns the new
/// size.
pub fn mutated(name: &str, bytes: &mut [u8], size: usize, max_size: usize, seed: u32) -> usize {
    let target = subaperture_tests::fuzz::target(name);
    let mut input = if seed.is_multiple_of(3) {
        let mut mutator = subaperture_tests::fuzz::Mutator::new(seed.into());
        mutator.make(target, &[bytes[..size].to_vec()])
    } else {
        let size = libfuzzer_sys::fuzzer_mutate(bytes, size, max_size);
        bytes[..size].to_vec()
    };
    if !seed.is_multiple_of(4) {
        (target.repair)(&mut input);
    }
    input.truncate(max_size);
    bytes[..input.len()].copy_from_slice(&input);
    input.len()
}
