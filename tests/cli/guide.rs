//! Commands and programs of README and guide, run as printed, each page in an empty folder.
//!
//! The blocks of a page run in order in one folder. Comments in its Markdown state their needs:
//!
//! | comment | meaning |
//! |---|---|
//! | `<!-- given: gotcha -->` | files from elsewhere: the real ones if present, otherwise made here ([`give`]) |
//! | `<!-- not run: REASON -->` | the next block is not run |
//! | `<!-- example: NAME -->` | the next block is this example of the library, word for word |
//! | `<!-- makes: FILE... -->` | files that the page leaves in the folder |
//! | `<!-- picture: FILE NAME -->` | a file that becomes `pictures/NAME` of the page's folder in the book |
//!
//! Pictures are kept in `target/guide/pictures`, from where `cargo xtask guide` copies them.

mod bring_up;
mod fusion;
mod links;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use subaperture_tests::firmware;
use subaperture_tests::numpy::{array, stored};
use subaperture_tests::subap::{example, program, root, run};

/// Put files that a reader downloads into `folder`.
fn give(name: &str, folder: &Path) {
    match name {
        "gotcha" => gotcha(folder),
        "srtm" => srtm(folder),
        "rail" => rail(folder),
        "lot.cphd" => lot(folder),
        "module" => module(folder),
        "strip.h5" => strip(folder),
        _ => panic!("no rule for '{name}'"),
    }
}

/// Firmware for the emulated board, where `cargo xtask module` puts it.
fn module(folder: &Path) {
    let place = folder.join("target/module");
    fs::create_dir_all(&place).unwrap();
    let built = firmware::module().unwrap_or_else(|error| panic!("{error}"));
    for (name, elf) in ["float", "fixed"].iter().zip(built) {
        fs::copy(elf, place.join(name)).unwrap();
    }
}

/// NISAR L0B file of two polarisations.
fn strip(folder: &Path) {
    let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
    let made = tempfile::tempdir().unwrap();
    let status = Command::new(&python)
        .arg(root().join("tests/python/l0b_write.py"))
        .arg(made.path())
        .status()
        .unwrap_or_else(|e| panic!("cannot run {python:?} ({e}) with numpy and h5py"));
    assert!(status.success(), "{status}");
    fs::copy(made.path().join("half.h5"), folder.join("strip.h5")).unwrap();
}

/// A page with its blocks.
struct Page {
    /// Path from the repository's root.
    path: String,
    blocks: Vec<Block>,
    given: Vec<String>,
    makes: Vec<String>,
    /// Files of the run, and their names in the book.
    pictures: Vec<(String, String)>,
}

struct Block {
    language: String,
    text: String,
    not_run: Option<String>,
    example: Option<String>,
}

/// README and every page of the guide, by their paths from the root.
fn paths() -> Vec<String> {
    fn add(folder: &Path, found: &mut Vec<String>) {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            if root().join(&path).is_dir() {
                add(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(path.to_str().unwrap().to_owned());
            }
        }
    }
    let mut found = vec!["README.md".to_owned()];
    add(Path::new("host/guide/src"), &mut found);
    found.sort();
    found
}

impl Page {
    fn read(path: &str) -> Self {
        let text = fs::read_to_string(root().join(path)).unwrap();
        let mut page = Self {
            path: path.to_owned(),
            blocks: Vec::new(),
            given: Vec::new(),
            makes: Vec::new(),
            pictures: Vec::new(),
        };
        let mut open: Option<Block> = None;
        let (mut not_run, mut example) = (None, None);
        for line in text.lines() {
            let comment = line
                .strip_prefix("<!-- ")
                .and_then(|l| l.strip_suffix(" -->"));
            if let (Some(comment), None) = (comment, &open) {
                let (key, value) = comment
                    .split_once(": ")
                    .unwrap_or_else(|| panic!("{path}: {line}"));
                let words = || value.split(' ').map(str::to_owned);
                match key {
                    "not run" => not_run = Some(value.to_owned()),
                    "example" => example = Some(value.to_owned()),
                    "given" => page.given.extend(words()),
                    "makes" => page.makes.extend(words()),
                    "picture" => {
                        let (file, name) = value.split_once(' ').unwrap();
                        page.pictures.push((file.to_owned(), name.to_owned()));
                    }
                    _ => panic!("{path}: unknown comment: {line}"),
                }
                continue;
            }
            match (&mut open, line.strip_prefix("```")) {
                (Some(_), Some(_)) => page.blocks.extend(open.take()),
                (Some(block), None) => block.text += &format!("{line}\n"),
                (None, Some(language)) => {
                    open = Some(Block {
                        language: language.to_owned(),
                        text: String::new(),
                        not_run: not_run.take(),
                        example: example.take(),
                    });
                }
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{path}: a block without its end");
        assert!(
            not_run.is_none() && example.is_none(),
            "{path}: a comment without its block"
        );
        page
    }

    /// Blocks that are run.
    fn runnable(&self) -> impl Iterator<Item = &Block> {
        let languages = ["sh", "python", "rust"];
        self.blocks.iter().filter(move |block| {
            block.not_run.is_none() && languages.contains(&block.language.as_str())
        })
    }

    /// Run every block in an empty folder, and return the folder.
    #[track_caller]
    fn run(&self) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in &self.given {
            give(name, folder.path());
        }
        for block in self.runnable() {
            match block.language.as_str() {
                "sh" => run_shell(folder.path(), &block.text),
                "python" => run_python(folder.path(), &block.text),
                _ => run_rust(folder.path(), block),
            }
        }
        for file in &self.makes {
            assert!(
                folder.path().join(file).exists(),
                "{}: no {file}",
                self.path
            );
        }
        let place = root().join("target/guide/pictures");
        fs::create_dir_all(&place).unwrap();
        for (file, name) in &self.pictures {
            fs::copy(folder.path().join(file), place.join(name))
                .unwrap_or_else(|error| panic!("{}: {file}: {error}", self.path));
        }
        folder
    }
}

#[test]
fn every_block_is_in_a_known_language() {
    let paths = paths();
    assert!(paths.len() > 10, "{paths:?}");
    for path in &paths {
        for block in Page::read(path).blocks {
            let known = ["sh", "python", "rust", "toml", "text", "json"];
            assert!(
                known.contains(&block.language.as_str()),
                "{path}: '{}'",
                block.language
            );
            let needs_example = block.language == "rust" && block.not_run.is_none();
            assert_eq!(
                block.example.is_some(),
                needs_example,
                "{path}: {}",
                block.text
            );
            if let Some(reason) = block.not_run {
                println!("not run: {path}: {reason}");
            }
        }
    }
}

/// Pages with their own test below.
const OWN_TESTS: [&str; 6] = [PHASE_HISTORY, OWN_RADAR, USRP, B210, NUCLEO, fusion::FUSION];
const PHASE_HISTORY: &str = "host/guide/src/tutorials/phase-history.md";
const OWN_RADAR: &str = "host/guide/src/tutorials/own-radar.md";
const USRP: &str = "host/guide/src/tutorials/usrp.md";
const B210: &str = "host/guide/src/tutorials/b210.md";
const NUCLEO: &str = "host/guide/src/tutorials/nucleo.md";

/// A test for each page with blocks, and one that checks that no page is left out.
macro_rules! pages {
    ($($test:ident: $path:literal,)*) => {
        $(#[test]
        fn $test() {
            Page::read($path).run();
        })*

        #[test]
        fn every_page_with_blocks_is_run() {
            let run = [OWN_TESTS.as_slice(), &[$($path),*]].concat();
            for path in paths() {
                let is_run = run.contains(&path.as_str());
                assert_eq!(is_run, Page::read(&path).runnable().count() > 0, "{path}");
            }
        }
    };
}

pages! {
    readme_runs: "README.md",
    autofocus_page_runs: "host/guide/src/howto/autofocus.md",
    channels_page_runs: "host/guide/src/howto/channels.md",
    cphd_page_runs: "host/guide/src/howto/cphd.md",
    displacement_page_runs: "host/guide/src/howto/displacement.md",
    export_page_runs: "host/guide/src/howto/export.md",
    gmti_page_runs: "host/guide/src/howto/gmti.md",
    jobs_page_runs: "host/guide/src/howto/jobs.md",
    l0b_page_runs: "host/guide/src/howto/l0b.md",
    library_page_runs: "host/guide/src/howto/library.md",
    maps_page_runs: "host/guide/src/howto/maps.md",
    measure_page_runs: "host/guide/src/howto/measure.md",
    pairs_page_runs: "host/guide/src/howto/pairs.md",
    pictures_page_runs: "host/guide/src/howto/pictures.md",
    scenes_page_runs: "host/guide/src/howto/scenes.md",
    surfaces_page_runs: "host/guide/src/howto/surfaces.md",
    truck_page_runs: "host/guide/src/howto/truck.md",
    velocity_page_runs: "host/guide/src/howto/velocity.md",
    cluster_page_runs: "host/guide/src/python/cluster.md",
    first_image_page_runs: "host/guide/src/tutorials/first-image.md",
    large_images_page_runs: "host/guide/src/tutorials/large-images.md",
    module_page_runs: "host/guide/src/tutorials/module.md",
    motion_page_runs: "host/guide/src/tutorials/motion.md",
}

#[track_caller]
fn succeeded(command: &mut Command, text: &str) {
    let output = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{:?} of\n{text}\n{said}",
        output.status.code()
    );
}

/// Run by a shell that stops at the first failure and has `subap` on its path.
#[track_caller]
fn run_shell(folder: &Path, text: &str) {
    let own = program().parent().unwrap().to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(own).chain(std::env::split_paths(&others)));
    let mut shell = Command::new("bash");
    shell
        .args(["-eu", "-c", text])
        .current_dir(folder)
        .env("PATH", path.unwrap());
    succeeded(&mut shell, text);
}

#[track_caller]
fn run_python(folder: &Path, text: &str) {
    let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
    succeeded(
        Command::new(python).args(["-c", text]).current_dir(folder),
        text,
    );
}

/// The program must equal an example of the library, so that it is compiled with everything else.
#[track_caller]
fn run_rust(folder: &Path, block: &Block) {
    let name = block.example.as_deref().unwrap();
    let source = root().join(format!("host/subaperture/examples/{name}.rs"));
    let source = fs::read_to_string(source).unwrap();
    // After the heading of the example.
    let (_, program) = source.split_once("\n\n").unwrap();
    assert_eq!(
        program, block.text,
        "the program is not that of examples/{name}.rs"
    );
    succeeded(Command::new(example(name)).current_dir(folder), &block.text);
}

/// A folder of real files, or `None` with a message.
fn real_folder(name: &str, file: &str) -> Option<PathBuf> {
    let folder = root().join("../shared/data").join(name);
    if folder.join(file).exists() {
        return Some(folder);
    }
    println!("skipped: {} not found", folder.join(file).display());
    None
}

/// A simulated degree of an aperture at 9.6 GHz in place of a GOTCHA file; the format of a file is recognised by its content.
fn stand_in(folder: &Path, name: &str, degree: u32) {
    let angle = f64::from(degree).to_radians();
    let (x_m, y_m) = (7000.0 * angle.sin(), -7000.0 * angle.cos());
    let (east, north) = (angle.cos(), angle.sin());
    let text = format!(
        "name = \"degree {degree}\"\n[radar]\nkind = \"ideal\"\npulses = 117\npri = \"1 ms\"\ncentre = \"9.6 GHz\"\nbandwidth = \"622 MHz\"\n\
         samples = 424\n[platform]\nkind = \"linear\"\nposition = \"{x_m}, {y_m}, 7000 m\"\nvelocity = \"{}, {}, 0 m/s\"\n\
         [scene]\nreference = \"0, 0, 0 m\"\nx = \"-50, 50 m\"\ny = \"-50, 50 m\"\n[[scene.point]]\nposition = \"-15.6, 21.6, 0 m\"\n",
        1000.0 * east,
        1000.0 * north
    );
    fs::write(folder.join("degree.toml"), text).unwrap();
    run(folder, "simulate degree.toml -o degree.cphd -q").succeeded();
    fs::rename(folder.join("degree.cphd"), folder.join(name)).unwrap();
    fs::remove_file(folder.join("degree.toml")).unwrap();
}

/// Two files of the GOTCHA recording, real ones if present.
fn gotcha(folder: &Path) {
    for degree in [1, 2] {
        let name = format!("data_3dsar_pass1_az00{degree}_HH.mat");
        match real_folder("gotcha", &name) {
            Some(real) => {
                fs::copy(real.join(&name), folder.join(&name)).unwrap();
            }
            None => stand_in(folder, &name, degree),
        }
    }
}

fn lot(folder: &Path) {
    run(folder, "simulate --preset table-4-1 -o lot.cphd -q").succeeded();
}

/// A tile of SRTM with 3 arc seconds: 1201 x 1201 big-endian heights from the north-west corner on, in metres.
fn srtm(folder: &Path) {
    let height = |row: usize, column: usize| {
        (20.0 + 5.0 * (row as f64 * 0.3).sin() + 3.0 * (column as f64 * 0.2).cos()) as i16
    };
    let tile: Vec<u8> = (0..1201 * 1201)
        .flat_map(|i| height(i / 1201, i % 1201).to_be_bytes())
        .collect();
    fs::write(folder.join("N52E004.hgt"), tile).unwrap();
}

#[test]
fn phase_history_page_shows_point_at_its_position() {
    let folder = Page::read(PHASE_HISTORY).run();
    // The point of the block at its position: pixels of the default grid are 0.1 m by 0.32 m.
    let record = fs::read(folder.path().join("mine/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let place = record["brightest"]["position_m"].as_array().unwrap();
    let off_m = [
        place[0].as_f64().unwrap() - 6.0,
        place[1].as_f64().unwrap() + 4.0,
    ];
    assert!(off_m[0].abs() < 0.1 && off_m[1].abs() < 0.32, "{place:?}");
    assert_eq!(record["collection"]["phase"][0]["reference"], "raw");
    assert_eq!(record["collection"]["phase"][0]["sign_basis"], "inferred");
}

/// A simulated impulse radar on a rail in place of the public recording: the reflector of the page's command, a range bias of 0.45 m, and
/// clocks 9.2 s apart.
fn rail_stand_in(folder: &Path) {
    let bytes =
        |values: &[f64]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    // At rest, an uneven push of 4 m, at rest.
    let at = |time_s: f64| {
        let part = ((time_s - 10.0) / 8.0).clamp(0.0, 1.0);
        [
            -3.0,
            -6.0 + 4.0 * (part + 0.04 * (3.0 * std::f64::consts::TAU * part).sin()),
            0.1,
        ]
    };
    let times: Vec<f64> = (0..2100).map(|n| 0.01 * f64::from(n)).collect();
    let places: Vec<f64> = times.iter().flat_map(|&time_s| at(time_s)).collect();
    let ranges: Vec<f64> = (0..960).map(|k| 2.0 + 0.00915 * f64::from(k)).collect();
    let scans_ms: Vec<u32> = (0..300).map(|n| 5000 + 35 * n).collect();
    let echo = |range_m: f64| {
        // 2.4 GHz around 4.3 GHz: a Gaussian of 4 cm.
        let turns = 2.0 * 4.3e9 * range_m / 299_792_458.0;
        1e4 * (-(range_m / 0.04).powi(2)).exp() * (std::f64::consts::TAU * turns).cos()
    };
    let scan = |&ms: &u32| {
        let place = at(9.2 + f64::from(ms - scans_ms[0]) * 1e-3);
        let off = [2.204 - place[0], -3.874 - place[1], 0.038 - place[2]];
        let recorded_m = off.iter().map(|d| d * d).sum::<f64>().sqrt() + 0.45;
        ranges.iter().map(move |range_m| echo(range_m - recorded_m))
    };
    let scans: Vec<f64> = scans_ms.iter().flat_map(scan).collect();
    let stamps: Vec<u8> = scans_ms.iter().flat_map(|ms| ms.to_le_bytes()).collect();
    let arrays = [
        ("scan_data.npy", array("<f8", "(300, 960)", &bytes(&scans))),
        ("scan_timestamps_ms.npy", array("<u4", "(300,)", &stamps)),
        ("range_bins_m.npy", array("<f8", "(960,)", &bytes(&ranges))),
        (
            "motion_timestamps_s.npy",
            array("<f8", "(2100,)", &bytes(&times)),
        ),
        (
            "platform_pos_m.npy",
            array("<f8", "(2100, 3)", &bytes(&places)),
        ),
    ];
    let members: Vec<(&str, &[u8])> = arrays
        .iter()
        .map(|(name, data)| (*name, data.as_slice()))
        .collect();
    fs::write(folder.join("rail_trial6.npz"), stored(&members)).unwrap();
}

/// The recording of the example, real if present.
fn rail(folder: &Path) {
    match real_folder("pulson440-rail", RAIL) {
        Some(real) => {
            fs::copy(real.join(RAIL), folder.join(RAIL)).unwrap();
        }
        None => rail_stand_in(folder),
    }
}

const RAIL: &str = "rail_trial6.npz";

#[test]
fn own_radar_page_tunes_range_bias_and_clock() {
    let folder = Page::read(OWN_RADAR).run();
    if real_folder("pulson440-rail", RAIL).is_none() {
        let text = fs::read_to_string(folder.path().join("rail.toml")).unwrap();
        let value = |key: &str| -> f64 {
            let line = text
                .lines()
                .find_map(|line| line.strip_prefix(key))
                .unwrap();
            let number = line.split('"').nth(1).unwrap().split(' ').next().unwrap();
            number.parse().unwrap_or_else(|_| panic!("{line}"))
        };
        // A step of the ranges on the page.
        assert!((value("range_bias = ") - 0.45).abs() < 0.05, "{text}");
        assert!((value("first_pulse = ") - 9.2).abs() < 0.04, "{text}");
    }
}

#[test]
fn usrp_page_shows_point_at_its_position() {
    let folder = Page::read(USRP).run();
    // Points of the scene are at 0, 5 m; -1.2, 3.5 m; 1, 6.5 m. The brightest pixel is at one of them within the resolution of 0.25 m.
    let record = fs::read(folder.path().join("rail-image/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let place = &record["brightest"]["position_m"];
    let [x, y] = [0, 1].map(|i| place[i].as_f64().unwrap());
    let near = [[0.0, 5.0], [-1.2, 3.5], [1.0, 6.5]]
        .iter()
        .any(|at| (x - at[0]).hypot(y - at[1]) < 0.25);
    assert!(near, "{place}");
}
