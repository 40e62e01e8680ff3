//! Checksums of the self-tests (`tests/firmware/selftest.rs` and `golden.rs` compare those of targets). That maps and pixels are
//! correct is verified by `map.rs`, `accumulate.rs`, `float.rs` and `fixed.rs`.

use subaperture_core::selftest::{FixedStreamSelfTest, FloatStreamSelfTest, SelfTest};

/// Changes only if the arithmetic changes: run this test, find the reason, then update the value.
const CHECKSUM: u32 = 0x8043_76ec;
const FLOAT_STREAM_CHECKSUM: u32 = 0xd92e_96d9;
const FIXED_STREAM_CHECKSUM: u32 = 0x30ac_7c05;

#[test]
fn selftest_checksum_is_recorded_and_repeatable() {
    let mut test = Box::new(SelfTest::new());
    let first = test.run().unwrap();
    assert_eq!(test.run().unwrap(), first, "buffers in use leave no trace");
    assert_eq!(
        first, CHECKSUM,
        "0x{first:08x} is not the recorded 0x{CHECKSUM:08x}"
    );
}

#[test]
fn stream_selftest_checksums_are_recorded_and_repeatable() {
    let mut float = FloatStreamSelfTest::new();
    let mut fixed = FixedStreamSelfTest::new();
    for (name, first, again, recorded) in [
        ("float", float.run(), float.run(), FLOAT_STREAM_CHECKSUM),
        ("fixed", fixed.run(), fixed.run(), FIXED_STREAM_CHECKSUM),
    ] {
        let first = first.unwrap();
        assert_eq!(again, Ok(first), "{name}: buffers in use leave no trace");
        assert_eq!(
            first, recorded,
            "{name}: 0x{first:08x} is not the recorded 0x{recorded:08x}"
        );
    }
}
