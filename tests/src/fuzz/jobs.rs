//! Pipelines: their TOML, and the state files of their folders.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use subaperture::describe::Description;
use subaperture::describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture::io::written::FileKind;
use subaperture::job::{Basis, FileStamp, FinishedStage, JobText, StageOutput, State};
use subaperture::units::Dimension;

pub(super) const WORDS: &[&str] = &[
    "[input]",
    "files = ",
    "[former]",
    "algorithm = ",
    "error = ",
    " dB",
    "[products]",
    "formats = [",
    "\"schema\"",
    "\"outputs\"",
    "\"path\"",
    "../",
    "null",
];

const SECTIONS: [&str; 3] = ["input", "former", "track"];

/// A key of every type of value that a job has.
static SCHEMA: LazyLock<Schema> = LazyLock::new(|| Schema {
    sections: vec![
        section("", "", vec![]),
        section(
            "input",
            "",
            vec![Key::new(
                "files",
                ValueType::Paths,
                Requirement::Required("\"a\""),
                "Files.",
            )],
        ),
        section(
            "former",
            "",
            vec![
                Key::new(
                    "algorithm",
                    ValueType::Choice(&["auto", "bp"]),
                    Requirement::Default("\"auto\""),
                    "Former.",
                ),
                Key::new(
                    "error",
                    ValueType::Quantity(Dimension::Level, Bounds::Any),
                    Requirement::Optional("\"-60 dB\""),
                    "Bound.",
                ),
                Key::new(
                    "portable",
                    ValueType::Flag,
                    Requirement::Default("false"),
                    "Bits.",
                ),
                Key::new(
                    "sub_cpi",
                    ValueType::Count(1, u64::MAX),
                    Requirement::Default("40"),
                    "Pulses.",
                ),
            ],
        ),
        section(
            "track",
            "source",
            vec![
                Key::new(
                    "source",
                    ValueType::Choice(&["mpga", "fused"]),
                    Requirement::Default("\"mpga\""),
                    "Source.",
                ),
                Key::new(
                    "navigation",
                    ValueType::Paths,
                    Requirement::Required("\"log\""),
                    "Logs.",
                )
                .when(&["fused"]),
                Key::new(
                    "lever_arm",
                    ValueType::Vector(Dimension::Length),
                    Requirement::Optional("\"0, 0, 1 m\""),
                    "Lever arm.",
                )
                .when(&["fused"]),
            ],
        ),
    ],
    introduction: "A job.",
});

fn section(path: &str, selector: &'static str, keys: Vec<Key>) -> Section {
    Section {
        path: path.to_owned(),
        presence: Presence::Always,
        when: &[],
        selector,
        doc: "",
        keys,
    }
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let stamp = FileStamp {
        path: "image.json".to_owned(),
        bytes: 9,
        crc32: "cbf43926".to_owned(),
    };
    let basis = Basis {
        version: "1".to_owned(),
        stage: "focus".to_owned(),
        settings: Default::default(),
        files: vec![stamp.clone()],
        after: BTreeMap::from([("track".to_owned(), "ff".to_owned())]),
    };
    let mut state = State::default();
    state.begin("focus", &basis.fingerprint());
    let begun = state.to_text();
    state.finish(FinishedStage {
        basis,
        outputs: vec![StageOutput {
            stamp,
            kind: Some(FileKind::Record),
        }],
        seconds: 1.0,
        resumed: false,
        warnings: Vec::new(),
        bound_missed: false,
    });
    let example = include_str!("../../../host/subap/src/commands/run/example.toml");
    let short = "[input]\nfiles = [\"a\", \"b\"]\n[track]\nsource = \"fused\"\nnavigation = \"log\"\nlever_arm = \"0, 0, 1 m\"\n";
    [example, short, &begun, &state.to_text()]
        .map(|text| text.as_bytes().to_vec())
        .to_vec()
}

pub(super) fn job(bytes: &[u8]) -> String {
    let state = match State::of_text(bytes) {
        Ok(state) => {
            let again = State::of_text(state.to_text().as_bytes());
            assert_eq!(again.expect("written state is read"), state);
            "a state".to_owned()
        }
        Err(message) => message,
    };
    let Ok(text) = std::str::from_utf8(bytes) else {
        return state;
    };
    match JobText::new(Description::new("input.toml", text, "/nowhere"), &SCHEMA) {
        Ok(job) => {
            let settings = job.settings(&SECTIONS);
            // All are numbers, strings and flags that JSON supports.
            let text = serde_json::to_string(&settings).expect("settings are JSON");
            let again: serde_json::Map<_, _> =
                serde_json::from_str(&text).expect("written settings are read");
            assert_eq!(again, settings);
            format!("a job of {} settings", settings.len())
        }
        Err(error) => {
            assert!(!error.faults.is_empty());
            format!("{state}; {error}")
        }
    }
}
