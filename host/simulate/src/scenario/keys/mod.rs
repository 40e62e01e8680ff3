//! The table of keys: everything that a scenario can say, with kind, default and explanation. The
//! reader checks texts against it, `subap simulate --keys` prints it, and tests hold that each key is
//! read.

mod scene;

use subaperture_describe::keys::{motion, place, radar};
use subaperture_describe::schema::{Key, Kind, Need, Presence, Schema, Section};

/// The scenario itself.
pub(super) static TOP: Section = Section {
    path: "",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "",
    keys: &[
        Key::new(
            "name",
            Kind::Text,
            Need::Default("\"scenario\""),
            "A name for titles and reports.",
        ),
        Key::new(
            "seed",
            Kind::Count(0, i64::MAX as u64),
            Need::Default("0"),
            "Seed of everything random: the same seed gives the same file.",
        ),
        Key::new(
            "method",
            Kind::Choice(&["fast", "sum"]),
            Need::Default("\"fast\""),
            "How sums over scatterers are computed: by FFTs, or plainly, which is slow and the measure \
             of the other.",
        ),
    ],
};

/// All that a scenario can say.
pub(super) static SCHEMA: Schema = Schema {
    sections: SECTIONS,
    introduction: "A scenario is TOML.",
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

/// Every key with its kind, default and explanation, as text.
pub fn reference() -> String {
    SCHEMA.reference()
}
