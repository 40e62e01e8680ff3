//! Options of formers by name, as `--option` and plans set them.

use serde_json::{Value, json};
use subaperture::focus::formers::{FORMERS, FormerOption, OptionType, OptionValues, former};

fn object(value: Value) -> OptionValues {
    value.as_object().cloned().unwrap()
}

/// Values that an option takes.
fn values(option: &FormerOption) -> Vec<Value> {
    match option.takes {
        OptionType::Count => vec![1.into(), 7.into()],
        OptionType::Length => vec![0.5.into()],
        OptionType::Bound => vec![(-45.0).into()],
        OptionType::Switch(_) => vec![true.into()],
        OptionType::Word(words) => words.iter().map(|word| word.name.into()).collect(),
        other => panic!("no values of {other:?} are known here"),
    }
}

#[test]
fn every_option_changes_settings_of_its_former() {
    for entry in &FORMERS {
        let plain = entry.settings(&OptionValues::new()).unwrap();
        let plain = former(entry.name, &plain).unwrap().settings();
        for option in entry.options {
            let mut changed = false;
            for value in values(option) {
                let mut given = OptionValues::new();
                given.insert(option.name.to_owned(), value);
                if let Some((other, word)) = option.with {
                    given.insert(other.to_owned(), word.into());
                }
                let settings = entry.settings(&given).unwrap();
                // A former refuses unknown settings.
                let settings = former(entry.name, &settings).unwrap().settings();
                changed |= settings != plain;
            }
            assert!(changed, "{}: {}", entry.name, option.name);
        }
    }
}

#[test]
fn options_of_one_name_agree_between_formers() {
    for entry in &FORMERS {
        for option in entry.options {
            let others = FORMERS.iter().filter_map(|other| other.option(option.name));
            for other in others {
                assert_eq!(option.takes, other.takes, "{}", option.name);
                assert_eq!(option.summary, other.summary, "{}", option.name);
            }
        }
    }
}

#[test]
fn settings_are_those_of_the_given_options() {
    let rdbp = FORMERS.iter().find(|entry| entry.name == "rdbp").unwrap();
    let settings = |given: Value| rdbp.settings(&object(given));
    assert_eq!(settings(json!({})), Ok(json!({})));
    assert_eq!(
        settings(json!({ "sub_cpi": 9, "patch": 2.5, "error_db": -50.0 })),
        Ok(json!({ "sub_cpi": 9, "patch_m": 2.5, "error_db": -50.0 }))
    );
    assert_eq!(
        settings(json!({ "no_keystone": true, "mode": "thesis", "error_db": -50.0 })),
        Ok(
            json!({ "mode": { "thesis": { "keystone": false, "error_db": -50.0 } }, "error_db": -50.0 })
        )
    );
    let refusal = |given: Value| settings(given).unwrap_err().to_string();
    assert_eq!(
        refusal(json!({ "no_src": true })),
        "rdbp has no option no_src"
    );
    assert_eq!(
        refusal(json!({ "no_keystone": true })),
        "no_keystone requires mode thesis"
    );
    assert_eq!(
        refusal(json!({ "patch": 3.0, "mode": "thesis" })),
        "patch has no effect with mode thesis"
    );
    for wrong in [
        json!({ "sub_cpi": 0 }),
        json!({ "mode": "fast" }),
        json!({ "error_db": 3 }),
    ] {
        assert!(refusal(wrong.clone()).contains("is not a valid"), "{wrong}");
    }
}
