//! What [`RangeDoppler`](super::RangeDoppler) can be told: the keys of its settings, and of [`Thesis`](super::Thesis)'s.

use crate::formers::options::{ERROR_DB, Opt, Takes, Word};

const MODE: &str = "mode";
const PRECISE: &str = "precise";
const THESIS: &str = "thesis";

pub(super) const ALL: [Opt; 5] = [
    Opt {
        name: MODE,
        summary: "How range-Doppler maps are made and read",
        takes: Takes::Word(&[
            Word {
                name: PRECISE,
                summary: "Patches compensated to their own centres, exact Keystone, Kaiser-Bessel kernel",
                setting: r#""precise""#,
            },
            Word {
                name: THESIS,
                summary: "As Schone 2020: sinc Keystone, zero padding, bilinear reading",
                setting: r#"{ "thesis": {} }"#,
            },
        ]),
        default: PRECISE,
        at: &[],
        with: None,
    },
    Opt {
        name: "no_keystone",
        summary: "Leave out the thesis mode's Keystone, which a fast target needs",
        takes: Takes::Switch(false),
        default: "",
        at: &["mode/thesis/keystone"],
        with: Some((MODE, THESIS)),
    },
    Opt {
        default: "-60, none in mode thesis",
        at: &["error_db", "mode/thesis/error_db"],
        ..ERROR_DB
    },
    Opt {
        name: "sub_cpi",
        summary: "Pulses a sub-CPI",
        takes: Takes::Count,
        default: "the most that the error bound allows; 40 in mode thesis",
        at: &[],
        with: None,
    },
    Opt {
        name: "patch",
        summary: "Side of patches in metres",
        takes: Takes::Length,
        default: "from the error bound",
        at: &[],
        with: Some((MODE, PRECISE)),
    },
];
