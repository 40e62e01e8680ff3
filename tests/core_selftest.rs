//! The self-test's own test: its checksum is pinned (`firmware.rs` compares the target's).
//! That its maps and pixels are right is shown by `core_map.rs` and `core_accumulate.rs`.

use subaperture_core::selftest::SelfTest;

/// Changes only when the arithmetic changes: then run this test, look at why, and write the new one.
const CHECKSUM: u32 = 0x8043_76ec;

#[test]
fn checksum_is_the_recorded_one_and_repeats() {
    let mut test = Box::new(SelfTest::new());
    let first = test.run().unwrap();
    assert_eq!(test.run().unwrap(), first, "buffers in use leave no trace");
    assert_eq!(
        first, CHECKSUM,
        "0x{first:08x} is not the recorded 0x{CHECKSUM:08x}"
    );
}
