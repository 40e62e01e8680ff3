//! Tests of the gallery: values of every item against tables in the tests, and the command `subap reproduce`.
//!
//! An item's own verdict is not used. Its printed values are compared
//! with the tables in `schone_points.rs`, `schone_scenes.rs`, `schone_gmti.rs`, `chim.rs`, `chim_radio.rs`, `chim_truck.rs`, `chim_motion.rs` and `chim_fusion.rs`: the thesis's number, or one from a formula in the test.

mod chim;
mod chim_fusion;
mod chim_motion;
mod chim_radio;
mod chim_truck;
mod command;
mod figures;
mod schone_gmti;
mod schone_points;
mod schone_scenes;
mod sub_cpis;
mod unfinished;

use std::collections::BTreeSet;

use subaperture::monitor::Silent;
use subaperture_gallery::{Context, items};

/// Memory limit of an item, bytes.
const MEMORY_BYTES: u64 = 1 << 30;

/// Assert that the item's checks are exactly those of its table.
#[track_caller]
fn assert_item(id: &str) {
    let item = items().into_iter().find(|item| item.id == id);
    let context = Context {
        memory_bytes: MEMORY_BYTES,
        monitor: &Silent,
        gotcha: &[],
        full: false,
        unfinished: None,
    };
    let found = (item.expect("an item of this name").reproduce)(&context).unwrap();
    let tables = [
        schone_points::figures,
        schone_scenes::figures,
        schone_gmti::figures,
        chim::figures,
        chim_motion::figures,
        chim_fusion::figures,
        chim_radio::figures,
        chim_truck::figures,
    ];
    let expected = tables.iter().find_map(|table| table(id));
    figures::compare(&expected.expect("a table for the item"), &found.checks);
    let scale = ["Scale: ", "Scaled down: "].into_iter();
    assert_eq!(
        scale.filter(|mark| found.method.contains(mark)).count(),
        1,
        "the method has to state its scale, once: {}",
        found.method
    );
    // Where figures differ, a line states the reason.
    assert!(found.agrees() || found.why.is_some(), "{:#?}", found.checks);
}

macro_rules! gallery {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                assert_item(&stringify!($name).replace('_', "-"));
            }
        )*

        #[test]
        fn every_item_has_a_table() {
            let here = [$(stringify!($name)),*].map(|name| name.replace('_', "-"));
            assert!(items().iter().map(|item| item.id).eq(here), "the list below is not that of the items");
        }
    };
}

gallery! {
    s_table_2_1 s_2_2 s_2_3 s_table_4_1 s_4_1 s_4_2 s_4_3 s_4_4 s_4_5 s_4_6 s_4_10 s_4_11 s_4_12 s_4_13 s_4_14 s_table_5_1 s_5_2
    s_6_1 s_6_2 s_6_2_keystone
    c_2_10 c_2_22 c_3_1 c_3_2 c_3_3 c_3_4 c_4_4 c_4_5 c_5_8 c_5_13 c_5_13_radio c_5_13_module c_6_6
    c_7_5 c_7_8 c_7_12 c_7_13 c_8_2
}

#[test]
fn item_ids_are_unique_and_safe_in_file_names() {
    let all = items();
    let ids: BTreeSet<&str> = all.iter().map(|item| item.id).collect();
    assert_eq!(ids.len(), all.len());
    for id in ids {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        assert!(id.chars().all(plain) && !id.starts_with('-'), "{id}");
    }
}
