//! Memory of the stream equals that in its documentation and in the plan of a module.

use subaperture::module::maps::Arithmetic;
use subaperture::module::plan::{RamBudget, image_bytes};
use subaperture_core::cfar::Column;
use subaperture_core::dpca::Dpca;
use subaperture_core::link::{max_frame_bytes, max_received_bytes};
use subaperture_core::stream::{
    Capacity, FixedBuffers, FixedMap, FixedScratch, FloatBuffers, FloatMap, FloatScratch, Patch,
    PulseStores,
};
use subaperture_core::{Complex32, Sc16};
use subaperture_firmware::products::{ChannelValues, Chip};

#[test]
fn buffers_have_documented_sizes() {
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
    // Rounded up to the 16 bits of a sample part.
    let documented = ((4 * f + blocks + 1) * rows + f).next_multiple_of(2);
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

#[test]
fn image_memory_of_plan_matches_firmware_buffers() {
    // Pixels, chips, and a bit per sub-CPI.
    let buffers = size_of::<[Complex32; 1000]>() + size_of::<[Chip; 4]>() + size_of::<[u8; 2]>();
    assert_eq!(image_bytes(1000, 4, 9), buffers as u64);
}

/// Statics of the firmware's application with these sizes, in float and in fixed point, and of its detector.
fn statics<
    const M: usize,
    const F: usize,
    const R: usize,
    const D: usize,
    const B: usize,
    const P: usize,
>() -> [usize; 3] {
    let link = max_received_bytes(F) + max_frame_bytes(F) + 8 * F;
    [
        PulseStores::<Complex32, M, F>::BYTES
            + FloatMap::<F, D>::BYTES
            + FloatScratch::<M, F, R, P>::BYTES
            + link,
        PulseStores::<Sc16, M, F>::BYTES
            + FixedMap::<F, D, B>::BYTES
            + FixedScratch::<M, F, R, P>::BYTES
            + link,
        size_of::<[Column; F]>() + size_of::<ChannelValues>(),
    ]
}

#[test]
fn module_plan_memory_matches_firmware_statics() {
    macro_rules! check {
        ($m:literal, $f:literal, $r:literal, $d:literal, $b:literal, $p:literal) => {
            let capacity = Capacity {
                pulses: $m,
                frequencies: $f,
                range_bins: $r,
                doppler_bins: $d,
                patches: $p,
            };
            let [float, fixed, options] = statics::<$m, $f, $r, $d, $b, $p>();
            let budget = RamBudget::new(&capacity, Arithmetic::Float);
            assert_eq!(budget.total_bytes, float as u64, "{capacity:?}");
            assert_eq!(budget.detections_bytes, options as u64);
            let budget = RamBudget::new(&capacity, Arithmetic::Fixed);
            assert_eq!(budget.total_bytes, fixed as u64, "{capacity:?}");
            // The kept map of the largest patch, whose sides are odd.
            let patch = Patch {
                range_reach: ($f - 1) / 2,
                doppler_reach: ($d - 1) / 2,
                ..Patch::EMPTY
            };
            let kept = (Dpca::kept_len(&patch) * size_of::<Complex32>()) as u64;
            if $f % 2 == 1 && $d % 2 == 1 {
                assert_eq!(budget.dpca_bytes, kept, "{capacity:?}");
            }
            assert!(kept <= budget.dpca_bytes, "{capacity:?}");
            let sum: u64 = budget.buffers.iter().map(|buffer| buffer.bytes).sum();
            assert_eq!(budget.total_bytes, sum);
        };
    }
    // The sizes of `firmware/src/sizes.rs`, odd ones, and the smallest.
    check!(16, 64, 128, 17, 3, 4);
    check!(32, 432, 1024, 45, 15, 16);
    check!(62, 512, 2048, 70, 17, 64);
    check!(7, 129, 256, 11, 6, 3);
    check!(1, 1, 2, 1, 2, 1);
    check!(40, 33, 64, 63, 3, 1);
    check!(5, 31, 32, 9, 2, 7);
}
