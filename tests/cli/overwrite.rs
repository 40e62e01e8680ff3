//! Rules for replacing files: only those that `subap` wrote, and never a command's own inputs.

use std::fs;
use std::path::Path;

use subaperture_tests::subap::{Ran, command, listing, run};

/// A scenario that takes a second: 24 pulses of a point. Its track is in a separate file.
const SCENARIO: &str = r#"
name = "one point"

[scene]
x = "-6, 6 m"
y = "-6, 6 m"

[[scene.point]]
position = "1, 2, 0 m"

[radar]
kind = "ideal"
pulses = 24
pri = "10 ms"
centre = "10 GHz"
bandwidth = "300 MHz"
samples = 64

[platform]
kind = "csv"
file = "track.csv"
"#;

const TRACK: &str = "time_s,x_m,y_m,z_m\n0,-5,400,200\n0.1,0,400,200\n0.3,5,400,200\n1,9,400,200\n";

const GRID: &str = "--grid x=-6:6:0.5,y=-6:6:0.5";

/// A folder with a scenario, its recording, an image and raw echoes.
fn workplace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), SCENARIO).unwrap();
    fs::write(at.join("track.csv"), TRACK).unwrap();
    run(at, "simulate scene.toml -o scene.cphd").succeeded();
    folder
}

fn refused(ran: &Ran, parts: &[&str]) {
    ran.failed(1, &[&["cannot write"], parts].concat());
}

#[test]
fn scenario_is_not_overwritten_by_its_output() {
    let folder = workplace();
    let at = folder.path();
    fs::create_dir(at.join("deep")).unwrap();
    fs::hard_link(at.join("scene.toml"), at.join("hard.cphd")).unwrap();
    std::os::unix::fs::symlink("scene.toml", at.join("soft.cphd")).unwrap();
    std::os::unix::fs::symlink("../deep/../scene.toml", at.join("deep/soft.cphd")).unwrap();
    let absolute = at.join("scene.toml").display().to_string();
    let before = listing(at);
    for out in [
        "scene.toml",
        "./scene.toml",
        "deep/../scene.toml",
        &absolute,
        "hard.cphd",
        "soft.cphd",
        "deep/soft.cphd",
        // A file that the scenario reads.
        "track.csv",
    ] {
        for force in ["", " --force"] {
            let ran = run(at, &format!("simulate scene.toml -o {out}{force}"));
            refused(&ran, &[out, "input of this run"]);
        }
    }
    assert_eq!(listing(at), before);
    assert_eq!(fs::read_to_string(at.join("scene.toml")).unwrap(), SCENARIO);
    assert_eq!(fs::read_to_string(at.join("track.csv")).unwrap(), TRACK);
}

#[test]
fn input_is_not_overwritten_by_output_of_another_kind() {
    let folder = workplace();
    let at = folder.path();
    let before = listing(at);
    // Nothing listens at this address: the command is refused before it connects.
    let ran = run(
        at,
        "link tcp://127.0.0.1:1 scene.cphd -o scene.cphd --force",
    );
    refused(&ran, &["scene.cphd", "input of this run"]);
    let ran = run(
        at,
        "link tcp://127.0.0.1:1 scene.cphd -o a.maps --picture scene.cphd --force",
    );
    refused(&ran, &["--picture", "scene.cphd", "input of this run"]);
    let ran = run(
        at,
        "link tcp://127.0.0.1:1 scene.cphd -o a.maps --picture a.maps",
    );
    refused(&ran, &["a.maps", "for two outputs"]);
    assert_eq!(listing(at), before);

    // A recording whose array has the same name as the image's.
    run(at, "simulate scene.toml --echoes raw").succeeded();
    let text = fs::read_to_string(at.join("raw/recording.toml")).unwrap();
    fs::create_dir(at.join("named")).unwrap();
    fs::write(
        at.join("named/recording.toml"),
        text.replace("echoes.npy", "image.npy"),
    )
    .unwrap();
    for name in ["times.npy", "track-times.npy", "transmitter.npy"] {
        fs::copy(at.join("raw").join(name), at.join("named").join(name)).unwrap();
    }
    fs::copy(at.join("raw/echoes.npy"), at.join("named/image.npy")).unwrap();
    let line = format!("focus named/recording.toml --out named {GRID} --force");
    refused(&run(at, &line), &["named/image.npy", "input of this run"]);
    run(at, &line.replace("--out named", "--out other")).succeeded();
}

/// Assert that `line` keeps a file `name` by another program, replaces it with `--force`, and then replaces its own file without.
#[track_caller]
fn replaces_only_its_own(at: &Path, line: &str, name: &str) {
    let file = at.join(name);
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    let mine = b"my own words\n";
    fs::write(&file, mine).unwrap();
    let before = listing(at);
    // An array without its record counts as a file of another program; the first such file is named.
    refused(&run(at, line), &["it exists, and", "--force"]);
    assert_eq!(listing(at), before, "{line}");
    assert_eq!(fs::read(&file).unwrap(), mine, "{line}");
    run(at, &format!("{line} --force")).succeeded();
    assert_ne!(fs::read(&file).unwrap(), mine, "{line}");
    run(at, line).succeeded();
    // An empty file may be replaced; an empty record does not make the arrays next to it our own.
    if !(name.ends_with(".json") || name.ends_with(".toml")) {
        fs::write(&file, b"").unwrap();
        run(at, line).succeeded();
        assert_ne!(fs::read(&file).unwrap(), b"", "{line}");
    }
}

#[test]
fn every_command_replaces_only_files_of_subap() {
    let folder = workplace();
    let at = folder.path();
    let focus = format!("focus scene.cphd {GRID} -a bp");
    let wide = focus.replace(GRID, "--grid x=-14:14:0.4,y=-14:14:0.4");
    run(at, &format!("{wide} --out image")).succeeded();
    run(at, "simulate scene.toml --echoes raw").succeeded();
    let velocity = "velocity scene.cphd --at 1,2 --vx=-1:1:0.5 --vy=-1:1:0.5 --out v";
    let tune = format!(
        "tune raw/recording.toml --vary recording.range_bias=0:1:0.5m --refine 0 --out tuned {GRID}"
    );
    for (line, names) in [
        ("simulate scene.toml -o other.cphd", &["other.cphd"][..]),
        (
            "simulate --preset table-4-1 -o preset.cphd",
            &["preset.cphd"],
        ),
        (
            "simulate scene.toml --echoes echoes",
            &[
                "echoes/echoes.npy",
                "echoes/recording.toml",
                "echoes/times.npy",
            ],
        ),
        (
            &format!("{focus} --out picture"),
            &[
                "picture/image.npy",
                "picture/image.json",
                "picture/image.png",
            ],
        ),
        (velocity, &["v/image.npy"]),
        ("picture image -o again.png", &["again.png"]),
        (
            "quality image --plots q --against image",
            &["q/point-1-x.png", "q/coherence.png"],
        ),
        (
            "plan radar scene.cphd --plots p",
            &["p/response.png", "p/ambiguity.png"],
        ),
        (
            &tune,
            &[
                "tuned/tune.json",
                "tuned/image.png",
                "tuned/recording.range_bias.png",
            ],
        ),
        (
            "reproduce --only s-2-2 --out g",
            &["g/index.html", "g/s-2-2.json", "g/s-2-2-migration.png"],
        ),
        (
            "demo --grid x=-2:2:1,y=-2:2:1 --out d",
            &["d/errors.md", "d/exact/image.npy"],
        ),
    ] {
        for name in names {
            replaces_only_its_own(at, line, name);
        }
    }
}

#[test]
fn maps_do_not_replace_other_files() {
    let folder = workplace();
    let at = folder.path();
    fs::write(at.join("thesis.maps"), "my own words").unwrap();
    let before = listing(at);
    let ran = run(at, "link tcp://127.0.0.1:1 scene.cphd -o thesis.maps");
    refused(&ran, &["thesis.maps", "--force"]);
    assert_eq!(listing(at), before);
}

#[test]
fn edited_files_are_not_replaced() {
    let folder = workplace();
    let at = folder.path();
    run(at, "simulate scene.toml --echoes raw").succeeded();
    // A length that a user measured again.
    let path = at.join("raw/recording.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        text.replace("[recording]\n", "[recording]\nrange_bias = \"0.2 m\"\n"),
    )
    .unwrap();
    let ran = run(at, "simulate scene.toml --echoes raw");
    refused(
        &ran,
        &["raw/recording.toml", "edited afterwards", "--force"],
    );
    // An image that a user filtered in place: the same size, other content.
    run(at, &format!("focus scene.cphd {GRID} --out image")).succeeded();
    let path = at.join("image/image.npy");
    let mut bytes = fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&path, &bytes).unwrap();
    let ran = run(at, &format!("focus scene.cphd {GRID} --out image"));
    refused(&ran, &["image/image.npy", "--force"]);
    assert_eq!(fs::read(&path).unwrap(), bytes);
}

#[test]
fn recording_by_another_program_is_not_replaced() {
    let folder = workplace();
    let at = folder.path();
    // The same pulses, by another program.
    let path = at.join("vendor.cphd");
    let bytes = fs::read(at.join("scene.cphd")).unwrap();
    let mark = b">subap</Parameter>";
    let place = bytes.windows(mark.len()).position(|w| w == mark).unwrap();
    let mut other = bytes.clone();
    other[place + 1..place + 6].copy_from_slice(b"radar");
    fs::write(&path, &other).unwrap();
    refused(
        &run(at, "simulate scene.toml -o vendor.cphd"),
        &["vendor.cphd", "--force"],
    );
    assert_eq!(fs::read(&path).unwrap(), other);
}

#[test]
fn symbolic_links_to_missing_files_are_followed() {
    let folder = workplace();
    let at = folder.path();
    fs::create_dir(at.join("disk")).unwrap();
    for (link, target) in [
        ("file.cphd", "disk/file.cphd"),
        ("image", "disk/image"),
        ("lost.cphd", "unmounted/file.cphd"),
        ("lost", "unmounted/image"),
        ("round.cphd", "round.cphd"),
    ] {
        std::os::unix::fs::symlink(target, at.join(link)).unwrap();
    }
    // Twice: first the target is missing, then it is the first run's file.
    for _ in 0..2 {
        run(at, "simulate scene.toml -o file.cphd").succeeded();
        run(at, &format!("focus scene.cphd {GRID} --out image")).succeeded();
    }
    for (link, file) in [
        ("file.cphd", "disk/file.cphd"),
        ("image", "disk/image/image.npy"),
    ] {
        assert!(
            at.join(link).symlink_metadata().unwrap().is_symlink(),
            "{link}"
        );
        assert!(at.join(file).metadata().unwrap().is_file(), "{file}");
    }
    // The target of a link may be on a disk that is not mounted: no folder is made there.
    let before = listing(at);
    refused(
        &run(at, "simulate scene.toml -o lost.cphd"),
        &[
            "lost.cphd",
            "symbolic link into a folder that does not exist",
        ],
    );
    refused(
        &run(at, &format!("focus scene.cphd {GRID} --out lost")),
        &["lost", "symbolic link into a folder that does not exist"],
    );
    refused(
        &run(at, "simulate scene.toml -o round.cphd"),
        &["round.cphd", "symbolic links"],
    );
    assert_eq!(listing(at), before);
}

#[test]
fn missing_folders_are_made_and_removed_after_failure() {
    let folder = workplace();
    let at = folder.path();
    run(at, "simulate scene.toml -o q/r/x.cphd").succeeded();
    assert!(at.join("q/r/x.cphd").is_file());
    run(at, &format!("focus scene.cphd {GRID} --out s/t/image")).succeeded();
    let before = listing(at);
    for line in [
        "simulate none.toml -o u/v/x.cphd",
        "focus none.cphd --out u/v/image",
        "tune none.toml --vary recording.range_bias=0:1:0.5m --at 0,0 --out u/v/t",
        "link tcp://127.0.0.1:1 scene.cphd -o u/v/a.maps",
    ] {
        assert_eq!(run(at, line).code, Some(1), "{line}");
        assert_eq!(listing(at), before, "{line}");
    }
}

#[test]
fn minus_is_not_a_file_name_for_standard_output() {
    let folder = workplace();
    let at = folder.path();
    let before = listing(at);
    for line in [
        "simulate scene.toml -o -",
        "simulate scene.toml --echoes -",
        "focus scene.cphd --out -",
        "velocity scene.cphd --at 1,2 --vx=-1:1:0.5 --vy=-1:1:0.5 --out -",
        "quality image --plots -",
        "plan radar --plots -",
        "tune a.toml --vary recording.range_bias=0:1:0.5m --at 0,0 --out -",
        "link tcp://127.0.0.1:1 scene.cphd -o -",
        "reproduce --out -",
        "demo --out -",
    ] {
        run(at, line).failed(2, &["standard output"]);
    }
    assert_eq!(listing(at), before);
    run(at, "simulate scene.toml -o ./-").succeeded();
    assert!(at.join("-").is_file());
}

#[test]
fn names_that_are_not_utf8_are_accepted() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = workplace();
    let at = folder.path();
    let odd = OsStr::from_bytes(b"r\xe9sum\xe9.cphd");
    fs::copy(at.join("scene.cphd"), at.join(odd)).unwrap();
    let odd_toml = OsStr::from_bytes(b"sc\xe8ne.toml");
    fs::copy(at.join("scene.toml"), at.join(odd_toml)).unwrap();
    let image = OsStr::from_bytes(b"im\xe4ge");
    let words = |line: &[&'static str]| line.iter().map(|w| OsStr::new(*w)).collect::<Vec<_>>();
    let grid = ["--grid", "x=-14:14:0.4,y=-14:14:0.4"];
    let ran = |mut line: Vec<&OsStr>, rest: &[&'static str]| -> Ran {
        line.extend(words(rest));
        command(at, line).output().unwrap().into()
    };
    let mut focus = words(&["focus"]);
    focus.extend([odd, OsStr::new("--out"), image]);
    ran(focus, &grid).succeeded();
    let record = fs::read(at.join(image).join("image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    assert_eq!(record["inputs"][0]["path"], "r\u{fffd}sum\u{fffd}.cphd");
    for (command, rest) in [
        ("info", &[][..]),
        ("info", &["--json"]),
        ("crosscheck", &["--sub-cpi", "8"]),
        ("plan", &[]),
        (
            "velocity",
            &[
                "--at",
                "1,2",
                "--vx=-1:1:0.5",
                "--vy=-1:1:0.5",
                "--out",
                "v",
            ],
        ),
    ] {
        let mut line = words(&[command]);
        if command == "plan" {
            line.push(OsStr::new("radar"));
        }
        line.push(odd);
        ran(line, rest).succeeded();
    }
    let mut simulate = words(&["simulate"]);
    simulate.extend([
        odd_toml,
        OsStr::new("--echoes"),
        OsStr::from_bytes(b"\xe9chos"),
        OsStr::new("-o"),
    ]);
    simulate.push(OsStr::from_bytes(b"\xff.cphd"));
    ran(simulate, &[]).succeeded();
    let mut quality = words(&["quality"]);
    quality.extend([image, OsStr::new("--against"), image, OsStr::new("--plots")]);
    quality.push(OsStr::from_bytes(b"pl\xf6ts"));
    ran(quality.clone(), &[]).succeeded();
    ran(quality, &["--json"]).succeeded();
    let recording = at
        .join(OsStr::from_bytes(b"\xe9chos"))
        .join("recording.toml");
    ran(vec![OsStr::new("info"), recording.as_os_str()], &[]).succeeded();
    let tune = words(&["tune"]);
    let tune = [
        tune,
        vec![
            recording.as_os_str(),
            OsStr::new("--out"),
            OsStr::from_bytes(b"t\xfcned"),
        ],
    ];
    ran(
        tune.concat(),
        &[
            "--vary",
            "recording.range_bias=0:1:0.5m",
            "--refine",
            "0",
            "--at",
            "1,2",
        ],
    )
    .succeeded();
}
