//! The memory of the streaming core is what its documentation says.

use subaperture_core::stream::{
    FixedBuffers, FixedMap, FixedScratch, FloatBuffers, FloatMap, FloatScratch, PulseStores,
};
use subaperture_core::{Complex32, Sc16};

#[test]
fn buffers_take_the_documented_bytes() {
    let (m, f, r, rows, p) = (30, 424, 1024, 41, 16);
    let blocks = 424usize.div_ceil(32);
    let stores = PulseStores::<Complex32, 30, 424>::BYTES;
    assert_eq!(stores, 16 * m * f + 144 * m);
    assert_eq!(stores, 207_840);
    let stores = PulseStores::<Sc16, 30, 424>::BYTES;
    assert_eq!(stores, 8 * m * f + 144 * m);
    assert_eq!(stores, 106_080);
    let map = FloatMap::<424, 41>::BYTES;
    assert_eq!(map, 8 * f * rows);
    assert_eq!(map, 139_072);
    let map = FixedMap::<424, 41, 15>::BYTES;
    // Rounded up to whole words.
    let documented = ((4 * f + blocks + 1) * rows + f).next_multiple_of(4);
    assert_eq!(map, documented);
    assert_eq!(map, 70_576);
    let scratch = FloatScratch::<30, 424, 1024, 16>::BYTES;
    assert_eq!(scratch, 8 * r + 40 * m + 4 * f + 32 * p);
    assert_eq!(scratch, 11_600);
    let scratch = FixedScratch::<30, 424, 1024, 16>::BYTES;
    assert_eq!(scratch, 8 * r + 48 * m + 4 * f + 32 * p);
    assert_eq!(scratch, 11_840);
    assert_eq!(
        FloatBuffers::<30, 424, 1024, 41, 16>::BYTES,
        207_840 + 139_072 + 11_600
    );
    assert_eq!(
        FixedBuffers::<30, 424, 1024, 41, 15, 16>::BYTES,
        106_080 + 70_576 + 11_840
    );
}
