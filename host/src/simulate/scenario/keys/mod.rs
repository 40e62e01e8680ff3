//! The table of keys: everything that a scenario can say, with kind, default and explanation. The
//! reader checks texts against it, `subap simulate --keys` prints it, and tests hold that each key is
//! read.

mod motion;
mod radar;
mod scene;

use std::fmt::Write;

use super::schema::{Key, Kind, Need, Presence, Section};

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

/// Every section, those within others after them.
pub(super) static SECTIONS: &[&Section] = &[
    &TOP,
    &scene::SCENE,
    &scene::ORIGIN,
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

/// The sections directly within the one at `path`.
pub(super) fn within(path: &str) -> impl Iterator<Item = &'static Section> {
    let sections = SECTIONS.iter().copied();
    sections.filter(move |section| section.parent() == Some(path))
}

/// Every key with its kind, default and explanation, as text.
pub fn reference() -> String {
    let mut text = String::from(
        "A scenario is TOML. Quantities are texts with a unit, as \"10 GHz\"; several are parted by\n\
         commas, and a number without a unit takes the one to its right: \"0, -5, 3 km\". Positions are\n\
         x, y, z in the scene frame: east, north and up at the origin, unless it says otherwise. Body\n\
         axes are x forward, y left, z up. Paths start at the scenario's folder.\n",
    );
    for section in SECTIONS {
        let _ = match section.path {
            "" => writeln!(text),
            _ => writeln!(text, "\n{}", section.header()),
        };
        let presence = match section.presence {
            Presence::Always => "",
            Presence::Optional => " May be left out.",
            Presence::Many => " Any number of them.",
        };
        let condition = condition(section.when, section.parent().and_then(selector_of));
        if !section.doc.is_empty() {
            wrap(
                &mut text,
                0,
                &format!("{}{presence}{condition}", section.doc),
            );
        }
        for key in section.keys {
            let need = match key.need {
                Need::Required(example) => format!("required, as {example}"),
                Need::Default(default) => format!("default {default}"),
                Need::Optional(example) => format!("optional, as {example}"),
            };
            let _ = writeln!(text, "  {} ({need})", key.name);
            let condition = self::condition(key.when, Some(section.selector));
            wrap(&mut text, 6, &format!("{}{condition}", key.doc));
            wrap(&mut text, 6, &format!("[{}]", key.kind.words()));
        }
    }
    text
}

fn selector_of(path: &str) -> Option<&'static str> {
    let found = SECTIONS.iter().find(|section| section.path == path);
    found.map(|section| section.selector)
}

fn condition(when: &[&'static str], selector: Option<&str>) -> String {
    match (when, selector) {
        ([], _) | (_, None) => String::new(),
        (when, Some(selector)) => {
            let words: Vec<String> = when.iter().map(|word| format!("\"{word}\"")).collect();
            format!(" Only with {selector} = {}.", words.join(", "))
        }
    }
}

/// Adds `words` in lines of at most 96 characters.
fn wrap(text: &mut String, indent: usize, words: &str) {
    let margin = " ".repeat(indent);
    let mut line = String::new();
    for word in words.split_whitespace() {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > 96 {
            let _ = writeln!(text, "{margin}{line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    let _ = writeln!(text, "{margin}{line}");
}
