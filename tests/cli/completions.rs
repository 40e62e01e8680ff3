//! Completion of commands, options and values in bash.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use subaperture_tests::subap::run;

/// Completes the last of its arguments like bash: calls the function that the script registers, and offers files if it has no offer.
const PRESS_TAB: &str = r#"
source ./completions.bash
registered=$(complete -p subap)
[[ $registered =~ -F\ ([^ ]+) ]] || exit 2
# The builtin works in a completion only. `plusdirs` adds folders.
compopt() { [[ $2 != plusdirs ]] || COMPREPLY+=($(compgen -d "$cur")); }
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
"${BASH_REMATCH[1]}" "$1" "${@: -1}" "${@: -2:1}"
if [[ ${#COMPREPLY[@]} == 0 && $registered == *" -o default "* ]]; then
    compgen -f "${@: -1}" || true
else
    printf '%s\n' "${COMPREPLY[@]}"
fi
"#;

/// Offers for the last word of `line`, which may be empty.
fn offers(folder: &Path, line: &str) -> BTreeSet<String> {
    let mut bash = Command::new("bash");
    bash.args(["--norc", "--noprofile", "-c", PRESS_TAB, "bash"]);
    let ran = bash
        .args(line.split(' '))
        .current_dir(folder)
        .output()
        .unwrap();
    let complaint = String::from_utf8(ran.stderr).unwrap();
    assert!(ran.status.success() && complaint.is_empty(), "{complaint}");
    let offers = String::from_utf8(ran.stdout).unwrap();
    offers.lines().map(str::to_owned).collect()
}

#[test]
fn bash_offers_commands_options_values_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ran = run(at, "completions bash");
    fs::write(at.join("completions.bash"), ran.succeeded()).unwrap();
    for name in ["radar.toml", "radar two.toml", "plan.json"] {
        fs::write(at.join(name), "").unwrap();
    }
    fs::create_dir(at.join("images")).unwrap();
    let radars = ["radar two.toml", "radar.toml"];
    for (line, expected) in [
        ("subap foc", &["focus"][..]),
        ("subap radio c", &["calibrate", "convert"]),
        ("subap plan ra", &["radar"]),
        ("subap focus --alg", &["--algorithm"]),
        ("subap focus scene.cphd --algorithm om", &["omega-k"]),
        ("subap plan radar --plo", &["--plots"]),
        // A file, a folder, and a file among the arguments.
        ("subap picture image -o ra", &radars),
        ("subap focus --plan pl", &["plan.json"]),
        ("subap focus -o i", &["images"]),
        ("subap info ra", &radars),
        ("subap info x", &[]),
    ] {
        let expected: BTreeSet<String> = expected.iter().map(|&word| word.to_owned()).collect();
        assert_eq!(offers(at, line), expected, "{line}");
    }
    // Options of other commands are not offered.
    let options = offers(at, "subap picture --");
    assert!(options.contains("--looks"), "{options:?}");
    assert!(!options.contains("--algorithm"), "{options:?}");
    let formers = offers(at, "subap focus -a ");
    for name in ["bp", "ffbp", "rdbp"] {
        assert!(formers.contains(name), "{formers:?}");
    }
}
