//! The table of keys against the builders, and whole scenarios against damage.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use super::keys::{SECTIONS, reference, within};
use super::schema::{Kind, Need, Presence, Section};
use super::*;

/// The words that a section's selector can have; one empty word if it has none.
fn variants(section: &Section) -> &'static [&'static str] {
    match section.key(section.selector).map(|key| key.kind) {
        Some(Kind::Choice(words)) => words,
        _ => &[""],
    }
}

/// Keys of which a scenario can have one only: the second goes where the first is not.
const EITHER: &[(&str, &str, &str)] = &[
    ("radar", "pri", "prf"),
    ("radar.pulse", "code", "phases"),
    ("scene", "reference", "reference_range"),
    ("scene.clutter", "density", "count"),
];

/// The section as text with the selector at `variant`: every key if `all`, of pairs the second if
/// `second`; else what is required and of each pair the first.
fn write_section(text: &mut String, section: &Section, variant: &str, all: bool, second: bool) {
    if !section.path.is_empty() {
        let _ = writeln!(text, "{}", section.header());
    }
    for key in section.keys {
        if !key.when.is_empty() && !key.when.contains(&variant) {
            continue;
        }
        let pair = EITHER
            .iter()
            .find(|(path, a, b)| *path == section.path && [*a, *b].contains(&key.name));
        let wanted = match pair {
            Some((_, first, _)) => (key.name == *first) != second,
            None => all || matches!(key.need, Need::Required(_)),
        };
        if key.name == section.selector {
            let _ = writeln!(text, "{} = \"{variant}\"", key.name);
        } else if wanted {
            let _ = writeln!(text, "{} = {}", key.name, key.example());
        }
    }
}

/// A scenario that has `section` with `variant`, and of others what is required.
fn scenario_with(section: &Section, variant: &str, all: bool, second: bool) -> String {
    let mut text = String::new();
    for other in SECTIONS {
        if std::ptr::eq(*other, section) {
            write_section(&mut text, section, variant, all, second);
        } else if other.path == "radar" {
            let kind = if section.path == "radar.pulse" { "pulsed" } else { "ideal" };
            write_section(&mut text, other, kind, false, false);
        } else if other.path == "radar.pulse" {
            if section.path == "radar" && variant == "pulsed" {
                write_section(&mut text, other, "lfm", false, false);
            }
        } else if other.presence == Presence::Always {
            write_section(&mut text, other, variants(other)[0], false, false);
        }
    }
    text
}

/// A folder with the files that examples name.
fn files() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let csv = "time_s,x_m,y_m,z_m\n0,-3,-5000,3000\n0.03,0,-5000,3000\n0.06,3,-5000,3000\n";
    std::fs::write(folder.path().join("track.csv"), csv).unwrap();
    // Two by two grey pixels.
    let file = std::fs::File::create(folder.path().join("picture.png")).unwrap();
    let mut png = png::Encoder::new(file, 2, 2);
    png.set_color(png::ColorType::Grayscale);
    png.set_depth(png::BitDepth::Eight);
    let mut png = png.write_header().unwrap();
    png.write_image_data(&[0, 85, 170, 255]).unwrap();
    folder
}

/// Every key of the table with every value of its section's selector makes a scenario, and a builder
/// takes it: `experiment` itself asserts that in debug builds, and this test repeats it for others.
#[test]
fn every_key_makes_a_scenario_and_is_read() {
    let folder = files();
    let mut seen = BTreeSet::new();
    for section in SECTIONS {
        for variant in variants(section) {
            for (all, second) in [(false, false), (true, false), (true, true)] {
                let text = scenario_with(section, variant, all, second);
                let scenario = Scenario::new("all.toml", &text, folder.path());
                if let Err(error) = scenario.experiment() {
                    panic!("{} {variant}: {error}\n{text}", section.path);
                }
                let header = section.header();
                for key in section.keys {
                    let line = format!("\n{} = ", key.name);
                    let part = match section.path {
                        "" => format!("\n{text}"),
                        _ => {
                            let start = text.find(&header).unwrap();
                            let rest = &text[start + header.len()..];
                            rest[..rest.find("\n[").unwrap_or(rest.len())].to_owned()
                        }
                    };
                    if part.contains(&line) {
                        seen.insert((section.path, key.name));
                    }
                }
            }
        }
    }
    for section in SECTIONS {
        for key in section.keys {
            assert!(seen.contains(&(section.path, key.name)), "{} {}", section.path, key.name);
        }
    }
}

#[test]
fn the_table_is_sound() {
    let reference = reference();
    let mut paths = BTreeSet::new();
    for section in SECTIONS {
        assert!(paths.insert(section.path), "{} twice", section.path);
        let parent = section.parent();
        assert!(parent.is_none_or(|path| paths.contains(path)), "{}", section.path);
        let mut names: BTreeSet<&str> = within(section.path).map(Section::name).collect();
        for key in section.keys {
            assert!(names.insert(key.name), "{} {} twice", section.path, key.name);
            assert!(key.doc.ends_with('.'), "{}", key.doc);
            let words = variants(section);
            assert!(key.when.iter().all(|value| words.contains(value)), "{}", key.name);
            assert!(reference.contains(&format!("  {} (", key.name)), "{}", key.name);
        }
    }
    assert!(reference.lines().all(|line| line.chars().count() <= 110));
}
