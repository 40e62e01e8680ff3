//! Options of [`RangeDopplerBackprojection`](super::RangeDopplerBackprojection) and [`Thesis`](super::Thesis).

use crate::formers::options::{ERROR_DB, FormerOption, OptionType, OptionWord};

/// Name of the former.
pub(super) const NAME: &str = "rdbp";

const MODE: &str = "mode";
const PRECISE: &str = "precise";
const THESIS: &str = "thesis";

pub(super) const ALL: [FormerOption; 5] = [
    FormerOption {
        name: MODE,
        summary: "Method of computing range-Doppler maps and of reading them",
        takes: OptionType::Word(&[
            OptionWord {
                name: PRECISE,
                summary: "Patches compensated to their own centres, nested if no size is given; Keystone within the Doppler transform",
                setting: r#""precise""#,
            },
            OptionWord {
                name: THESIS,
                summary: "As Schone 2020: sinc Keystone, zero padding, bilinear reading",
                setting: r#"{ "thesis": {} }"#,
            },
        ]),
        default: PRECISE,
        at: &[],
        with: None,
    },
    FormerOption {
        name: "no_keystone",
        summary: "Leave out the thesis mode's Keystone, which a fast target needs",
        takes: OptionType::Switch(false),
        default: "",
        at: &["mode/thesis/keystone"],
        with: Some((MODE, THESIS)),
    },
    FormerOption {
        default: "-60, none in mode thesis",
        at: &["error_db", "mode/thesis/error_db"],
        ..ERROR_DB
    },
    FormerOption {
        name: "sub_cpi",
        summary: "Pulses per sub-CPI",
        takes: OptionType::Count,
        default: "largest length within the error bound; 40 in mode thesis",
        at: &[],
        with: None,
    },
    FormerOption {
        name: "patch",
        summary: "Side of patches in metres",
        takes: OptionType::Length,
        default: "from the error bound",
        at: &[],
        with: Some((MODE, PRECISE)),
    },
];
