//! The schema of jobs against the options of the commands.

use std::path::Path;

use serde_json::json;
use subaperture::describe::{Description, DescriptionError};
use subaperture::focus::BoundPolicy;
use subaperture::job::JobText;

use super::*;
use crate::commands::run::sections::Sections;

fn job(text: &str) -> Result<(JobText, Sections), DescriptionError> {
    let job = JobText::new(Description::new("job.toml", text, "/data"), &SCHEMA)?;
    let sections = Sections::read(&job).map_err(|faults| job.explain(faults))?;
    Ok((job, sections))
}

#[test]
fn the_example_is_a_job_and_names_every_section_and_key() {
    let (job, _) = job(EXAMPLE).unwrap();
    assert_eq!(job.path("a.cphd"), Path::new("/data/a.cphd"));
    for section in &SCHEMA.sections {
        let header = section.header();
        assert!(
            section.path.is_empty() || EXAMPLE.contains(&header),
            "{header}"
        );
        for key in &section.keys {
            let example = example(&section.path, key.name);
            assert!(!example.is_empty(), "{header} {}", key.name);
            assert!(!key.doc.is_empty(), "{header} {}", key.name);
            if let Requirement::Default(default) = key.need
                && !section.keys.iter().any(|key| key.name == "source")
            {
                assert_eq!(example, default, "{header} {}", key.name);
            }
        }
    }
}

#[test]
fn every_example_of_the_example_is_valid() {
    let selected = [
        ("track", "source"),
        ("autofocus", "method"),
        ("former", "algorithm"),
        ("picture", "remap"),
    ];
    for section in &SCHEMA.sections {
        for key in &section.keys {
            let selector = selected.iter().find(|(name, _)| *name == section.path);
            let mut lines = vec![format!("{} = {}", key.name, key.example())];
            if let (Some((_, selector)), [value, ..]) = (selector, key.when) {
                lines.push(format!("{selector} = \"{value}\""));
            }
            // Keys that others need.
            lines.extend(match (&*section.path, key.name) {
                ("former", "squint") => Some("beam = \"auto\"".to_owned()),
                ("former", "doppler_centroid") => Some("doppler_band = \"1 kHz\"".to_owned()),
                ("track", "navigation_start" | "lever_arm") => {
                    Some("navigation = \"a.log\"".to_owned())
                }
                _ => None,
            });
            let lines = lines.join("\n");
            let text = match &*section.path {
                "" => format!("{lines}\n[input]\nfiles = \"a\"\n"),
                "input" if key.name == "files" => format!("[input]\n{lines}\n"),
                "input" => format!("[input]\nfiles = \"a\"\n{lines}\n"),
                path => format!("[input]\nfiles = \"a\"\n[{path}]\n{lines}\n"),
            };
            if let Err(error) = job(&text) {
                panic!("{text}\n{error}");
            }
        }
    }
}

#[test]
fn settings_take_defaults_and_omit_unrequested_stages() {
    let (job, _) = job("[input]\nfiles = \"a.cphd\"\n[former]\nerror = \"-40 dB\"\n").unwrap();
    let settings = job.settings(&["former", "autofocus", "check"]);
    assert_eq!(settings["former.error"], json!(-40.0));
    assert_eq!(settings["former.algorithm"], json!("auto"));
    assert_eq!(settings["check.pixels"], json!(64));
    assert!(!settings.keys().any(|key| key.starts_with("autofocus")));
}

#[test]
fn a_value_of_a_key_is_that_of_its_option() {
    let text = "[input]\nfiles = [\"a.cphd\", \"/b.cphd\"]\n[grid]\npixels = \"x=-1:1:0.5,y=0:2:1\"\nsurface = \"dem:heights\"\n\
                [former]\nalgorithm = \"rdbp\"\nerror = \"-50 dB\"\npatch = \"8 m\"\nslow_window = \"hamming\"\nbeam = \"2 deg\"\n\
                squint = \"-1.5 deg\"\nvelocity = \"36, 0, 0 km/h\"\nscratch = \"1M\"\n[picture]\ntop = \"-10 dB\"\nspan = \"45 dB\"\n\
                [autofocus]\nmethod = \"map-drift\"\nlooks = 3\n[quality]\nat = [\"1, 2 m\"]\n[products]\nplace = \"40, -86\"\n";
    let (_, sections) = job(text).unwrap();
    let (_, moving) = job("[input]\nfiles = \"a.cphd\"\n[former]\nmotion = \"car.csv\"\n").unwrap();
    let motion = moving.former.target.motion.unwrap();
    assert_eq!(motion, Path::new("/data/car.csv"));
    let line = "subap focus /data/a.cphd /b.cphd --grid x=-1:1:0.5,y=0:2:1 --surface dem:/data/heights -a rdbp --error-db -50 --patch 8 \
                --slow-window hamming --beam 2deg --squint -1.5deg --velocity 36,0,0km/h --scratch 1M --top -10 --span 45 --out d \
                --product cog --place 40,-86";
    let args = <args::Args as clap::Parser>::try_parse_from(line.split_whitespace()).unwrap();
    let Some(args::Command::Focus(focus)) = args.command else {
        panic!("not focus");
    };
    let same = |own: &dyn std::fmt::Debug, options: &dyn std::fmt::Debug| {
        assert_eq!(format!("{own:?}"), format!("{options:?}"));
    };
    same(&sections.input, &focus.input);
    same(&sections.grid, &focus.image.grid);
    same(&sections.former.forming, &focus.image.forming);
    same(&sections.former.target, &focus.target);
    same(&sections.picture, &focus.look);
    same(&sections.products.place, &focus.producing.place);
    let autofocus = sections.autofocus.unwrap();
    assert_eq!(
        (autofocus.method, autofocus.looks),
        (args::Method::MapDrift, 3)
    );
    assert_eq!((autofocus.rounds, autofocus.points), (16, None));
    let at = sections.quality.places.at[0];
    assert_eq!(
        (at.x, at.y, at.z, sections.quality.points),
        (1.0, 2.0, None, 5)
    );
}

#[test]
fn error_bound_of_a_job_is_a_limit_unless_it_allows_more() {
    for (keys, policy) in [
        ("error = \"-50 dB\"", BoundPolicy::Refused),
        (
            "error = \"-50 dB\"\nallow_error = true",
            BoundPolicy::Allowed,
        ),
        (
            "error = \"-50 dB\"\nalgorithm = \"bp\"",
            BoundPolicy::Allowed,
        ),
        ("portable = true", BoundPolicy::Allowed),
    ] {
        let (_, sections) = job(&format!("[input]\nfiles = \"a\"\n[former]\n{keys}\n")).unwrap();
        assert_eq!(sections.former.forming.bound_policy(), policy, "{keys}");
    }
}

#[test]
fn formers_and_all_their_options_are_keys() {
    let former = SCHEMA.sections.iter().find(|s| s.path == "former").unwrap();
    let ValueType::Choice(names) = former.key("algorithm").unwrap().kind else {
        panic!("not a choice");
    };
    for entry in &FORMERS {
        assert!(names.contains(&entry.name), "{}", entry.name);
        for option in entry.options {
            let name = args::former_key(option);
            let key = former.key(name).unwrap_or_else(|| panic!("no key {name}"));
            let takes = key.when.is_empty() || key.when.contains(&entry.name);
            assert!(takes, "{name} of {}", entry.name);
        }
    }
    assert_eq!(names.len(), FORMERS.len());
}

#[test]
fn faults_are_shown_with_their_line() {
    for (text, place, parts) in [
        (
            "[inptu]\nfiles = \"a\"\n",
            "job.toml:1:2",
            ["inptu", "did you mean 'input'"],
        ),
        (
            "[input]\nfiles = \"a\"\n[former]\nalgorithm = \"ffpb\"\n",
            "job.toml:4:13",
            ["ffpb", "did you mean \"ffbp\""],
        ),
        (
            "[input]\nfiles = \"a\"\n[products]\nformats = [\"sicd\", \"cogs\"]\n",
            "job.toml:4:20",
            ["cogs", "did you mean \"cog\""],
        ),
        (
            "[input]\nfiles = \"a\"\n[former]\nerror = -40\n",
            "job.toml:4:9",
            ["error", "without a unit"],
        ),
        (
            "[input]\nfiles = \"a\"\n[track]\nsource = \"mpga\"\n[autofocus]\n",
            "job.toml:5:1",
            ["as recorded", "leave one of the two out"],
        ),
        (
            "[input]\nfiles = \"a\"\n[track]\nsource = \"mpga\"\nfile = \"t.csv\"\n",
            "job.toml:5:1",
            ["file", "does not apply"],
        ),
        (
            "[input]\nfiles = \"a\"\n[former]\nwindow = \"blackman\"\nbeam = \"wide\"\n",
            "job.toml:5:8",
            ["or auto, or none", "give an angle"],
        ),
        (
            "[input]\nfiles = \"a\"\n[former]\nsquint = \"2 deg\"\n",
            "job.toml:4:10",
            ["'squint' needs 'beam'", "beam = "],
        ),
        (
            "[input]\nfiles = \"a\"\n[picture]\nremap = \"density\"\nspan = \"40 dB\"\n",
            "job.toml:5:1",
            [
                "'span' does not apply to remap = \"density\"",
                "choose \"db\"",
            ],
        ),
        (
            "[input]\nfiles = [\"a\", \"b\"]\n[track]\nsource = \"mpga\"\n",
            "job.toml:2:9",
            ["estimated from one recording", "name one file"],
        ),
    ] {
        let error = job(text).map(|_| ()).unwrap_err();
        let fault = error.faults.iter().find(|fault| fault.place == place);
        let fault = fault.unwrap_or_else(|| panic!("{place}: {error}"));
        assert!(fault.excerpt.contains('^'), "{error}");
        for part in parts {
            assert!(fault.message.contains(part), "{part}: {error}");
        }
    }
    let none = job("").map(|_| ()).unwrap_err().to_string();
    assert!(none.contains("files"), "{none}");
}
