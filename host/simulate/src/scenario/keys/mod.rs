//! Table of all scenario keys with type, default and description. The reader checks texts against it, `subap simulate
//! --keys` prints it, and tests check that each key is read.

mod scene;

use subaperture_describe::keys::{motion, place, radar};
use subaperture_describe::schema::{Key, Presence, Requirement, Schema, Section, ValueType};

/// Top-level keys.
pub(super) static TOP: Section = Section {
    path: "",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "",
    keys: &[
        Key::new(
            "name",
            ValueType::Text,
            Requirement::Default("\"scenario\""),
            "Name of the collection, for titles and reports.",
        ),
        Key::new(
            "seed",
            ValueType::Count(0, i64::MAX as u64),
            Requirement::Default("0"),
            "Seed of all random effects: the same seed gives the same file.",
        ),
        Key::new(
            "method",
            ValueType::Choice(&["fast", "sum"]),
            Requirement::Default("\"fast\""),
            "Method for sums over scatterers: by non-uniform FFT, or by the plain sum, which is slow \
                        and the reference for the fast method.",
        ),
    ],
};

/// Schema of a scenario.
pub(super) static SCHEMA: Schema = Schema {
    sections: SECTIONS,
    introduction: "A scenario is a TOML file.",
};

static SECTIONS: &[&Section] = &[
    &TOP,
    &scene::SCENE,
    &place::ORIGIN,
    &scene::POINT,
    &scene::CORNER,
    &scene::CLUTTER,
    &scene::PICTURE,
    &scene::BUILDING,
    &motion::MOVER,
    &radar::RADAR,
    &radar::PULSE,
    &radar::TRANSMITTER,
    &radar::RECEIVER,
    &radar::NOISE,
    &radar::PHASE_NOISE,
    &radar::CLOCK,
    &radar::INTERFERENCE,
    &radar::CONVERTER,
    &motion::PLATFORM,
    &motion::PERTURBATION,
    &motion::NAVIGATION,
];

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}
