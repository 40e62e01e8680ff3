//! `subap focus --tiled` and `subap plan focus`: killed runs resume, parts form the whole to the bit, two runs with one folder exclude each
//! other, and images may be larger than memory.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::io::claim::OutputClaims;
use subaperture_tests::subap::{command, listing, run};

/// A straight track that every former accepts.
const SCENE: &str = r#"
name = "tiles"
seed = 3

[scene]
x = "-60, 60 m"
y = "-60, 60 m"
reference = "0, 0, 0 m"

[scene.origin]
latitude = "40 deg"
longitude = "-86 deg"

[[scene.point]]
position = "3, 4, 0 m"

[[scene.point]]
position = "-31, 22, 0 m"

[radar]
kind = "ideal"
pulses = 300
pri = "4 ms"
centre = "10 GHz"
bandwidth = "100 MHz"
samples = 200

[platform]
kind = "linear"
position = "0, -4, 3 km"
velocity = "100, 0, 0 m/s"
at = "middle"
"#;

/// One bright point among dark pixels.
const BRIGHT: &str = r#"
name = "bright"

[scene]
x = "-60, 60 m"
y = "-60, 60 m"

[[scene.point]]
position = "-40, 40, 0 m"

[[scene.point]]
position = "30, -30, 0 m"
cross_section = "-60 dBsm"

[radar]
kind = "ideal"
pulses = 300
pri = "4 ms"
centre = "10 GHz"
bandwidth = "100 MHz"
samples = 200

[platform]
kind = "linear"
position = "0, -4, 3 km"
velocity = "100, 0, 0 m/s"
at = "middle"
"#;

/// All files of an image's store that are not hidden, with their content.
fn store(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fn walk(root: &Path, folder: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                walk(root, &path, files);
            } else if !name.starts_with('.') {
                let key = path.strip_prefix(root).unwrap().display().to_string();
                files.insert(key, fs::read(path).unwrap());
            }
        }
    }
    let root = folder.join("image.zarr");
    let mut files = BTreeMap::new();
    walk(&root, &root, &mut files);
    files
}

fn recording(folder: &Path) {
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
    run(folder, "simulate scene.toml -o a.cphd").succeeded();
}

/// Options of each former: at least 2 tiles, mostly 64, with as few pixels as that needs.
const FORMERS: [(&str, &str); 8] = [
    ("exact", "-a exact --grid x=-40:40:1.2,y=-40:40:1.2"),
    ("bp", "-a bp --grid x=-60:60:0.4,y=-60:60:0.4"),
    ("rdbp", "-a rdbp --grid x=-60:60:0.2,y=-60:60:0.2"),
    (
        "thesis",
        "-a rdbp --mode thesis --grid x=-60:60:0.3,y=-60:60:0.3",
    ),
    ("ffbp", "-a ffbp --grid x=-60:60:0.2,y=-60:60:0.2"),
    (
        "pfa",
        "-a pfa --allow-error --grid x=-40:40:0.16,y=-40:40:0.16",
    ),
    (
        "omega-k",
        "-a omega-k --allow-error --grid x=-40:40:0.16,y=-40:40:0.16",
    ),
    (
        "rda",
        "-a rda --allow-error --grid x=-40:40:0.16,y=-40:40:0.16",
    ),
];

/// Hidden files and locks anywhere in a folder.
fn hidden(folder: &Path) -> Vec<std::path::PathBuf> {
    let is_hidden = |path: &std::path::PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().starts_with('.')
    };
    listing(folder).into_keys().filter(is_hidden).collect()
}

/// A grid of 4e16 pixels, by options and by an edited plan.
#[test]
fn grids_larger_than_any_image_are_refused_before_they_are_planned() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder);
    let huge = [
        "200000000 x 200000000 pixels",
        "a smaller or coarser --grid",
    ];
    for (_, former) in FORMERS {
        let former = former
            .split("--grid")
            .next()
            .unwrap()
            .replace("--allow-error", "");
        let line =
            format!("plan focus a.cphd {former} --grid x=-1e8:1e8:1,y=-1e8:1e8:1 -o huge.json");
        run(folder, &line).failed(1, &huge);
        let line = format!("plan focus a.cphd {former} --grid x=-10:10:1,y=-10:10:1 -o plan.json");
        run(folder, &line).succeeded();
        let plan = fs::read_to_string(folder.join("plan.json")).unwrap();
        let edited = plan.replace("\"count\": 20,", "\"count\": 200000000,");
        let edited = edited.replace("\"count\": 20\n", "\"count\": 200000000\n");
        assert_ne!(edited, plan, "{plan}");
        fs::write(folder.join("edited.json"), edited).unwrap();
        run(folder, "focus a.cphd --plan edited.json -o image").failed(1, &huge[..1]);
    }
}

#[test]
fn killed_runs_resume_with_same_bits() {
    assert_killed_runs_resume(6);
}

#[test]
#[ignore = "minutes: cargo xtask long"]
fn runs_killed_twenty_times_resume_with_same_bits() {
    assert_killed_runs_resume(20);
}

/// Kill each former's run so many times; the result of the last run equals that of an undisturbed run.
fn assert_killed_runs_resume(kills: usize) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (name, options) in FORMERS {
        let whole = format!("focus a.cphd {options} --tiled -o whole-{name}");
        let begun = Instant::now();
        let ran = run(folder, &whole);
        assert!(matches!(ran.code, Some(0 | 3)), "{name}: {}", ran.stderr);
        let took_ms = begun.elapsed().as_millis() as u64;
        let expected = store(&folder.join(format!("whole-{name}")));
        let tiles = expected.keys().filter(|key| key.starts_with('c')).count();

        let line = format!("focus a.cphd {options} --tiled --resume -o {name}");
        let (mut killed, mut amid) = (0, 0);
        while killed < kills {
            let mut child = command(folder, line.split_whitespace())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            // Mostly while tiles are formed and written.
            sleep(Duration::from_millis(random.next_u64() % (took_ms + 1)));
            child.kill().unwrap();
            let status = child.wait().unwrap();
            killed += 1;
            let done = folder.join(format!("{name}/image.zarr/done"));
            let there = fs::read_dir(done).map_or(0, |marks| {
                marks
                    .filter(|mark| {
                        let name = mark.as_ref().unwrap().file_name();
                        !name.to_string_lossy().starts_with('.')
                    })
                    .count()
            });
            amid += usize::from(there > 0 && there < tiles);
            if status.success() || folder.join(format!("{name}/image.json")).exists() {
                // The run ended first; begin again.
                fs::remove_dir_all(folder.join(name)).unwrap();
            }
        }
        let ran = run(folder, &line);
        assert!(matches!(ran.code, Some(0 | 3)), "{name}: {}", ran.stderr);
        println!(
            "{name}: {tiles} tiles, {took_ms} ms undisturbed; {amid} of {killed} kills left a part of them"
        );
        let got = store(&folder.join(name));
        assert!(got.keys().eq(expected.keys()), "{name}");
        for (file, bytes) in &expected {
            assert!(*bytes == got[file], "{name}: {file}");
        }
        assert!(folder.join(format!("{name}/image.png")).is_file());
        // Partial files of killed runs are removed.
        let left = hidden(&folder.join(name));
        assert!(left.is_empty(), "{name}: {left:?}");
    }
}

/// Eight processes, one part each, in any order; two of them killed and started again.
#[test]
fn eight_processes_form_one_image() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder);
    let grid = "--grid x=-60:60:0.25,y=-60:60:0.25";
    run(
        folder,
        &format!("plan focus a.cphd -a bp {grid} -o plan.json"),
    )
    .succeeded();
    run(folder, &format!("focus a.cphd -a bp {grid} --tiled -o one")).succeeded();
    let start = |part: usize| -> std::process::Child {
        let mut part_of: Command = command(
            folder,
            format!("focus a.cphd --plan plan.json --tiles {part}/8 -o all --threads 1")
                .split_whitespace(),
        );
        part_of.stdout(Stdio::null()).spawn().unwrap()
    };
    let mut order: Vec<usize> = (1..=8).collect();
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for i in (1..8).rev() {
        order.swap(i, random.next_u64() as usize % (i + 1));
    }
    let mut running: Vec<(usize, std::process::Child)> =
        order.iter().map(|&part| (part, start(part))).collect();
    sleep(Duration::from_millis(250));
    for (part, child) in running.iter_mut().take(2) {
        child.kill().unwrap();
        child.wait().unwrap();
        *child = start(*part);
    }
    for (part, mut child) in running {
        assert!(child.wait().unwrap().success(), "part {part}");
    }
    assert!(store(&folder.join("all")) == store(&folder.join("one")));
    // The last process wrote the record and the picture.
    assert!(folder.join("all/image.png").is_file());
    let said = run(folder, "compare one all");
    assert!(
        said.succeeded().contains("correlation          1.0000"),
        "{said:?}"
    );
}

#[test]
fn existing_tiles_are_not_lost_by_mistake() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder);
    let grid = "--grid x=-20:20:0.5,y=-20:20:0.5";
    let line = format!("focus a.cphd {grid} --tiled -o d");
    run(folder, &line).succeeded();
    let before = store(&folder.join("d"));
    run(folder, &line).failed(2, &["image.zarr", "--resume", "--force"]);
    run(folder, &format!("focus a.cphd {grid} --resume -a bp -o d"))
        .failed(1, &["tiles of the same plan, found another", "--force"]);
    assert!(store(&folder.join("d")) == before);
    // All tiles exist: none is formed, and the record is written again.
    let ran = run(folder, &format!("focus a.cphd {grid} --resume -o d"));
    assert!(ran.succeeded().contains("80 x 80"), "{ran:?}");
    assert!(store(&folder.join("d")) == before);
    // Another recording with the same plan.
    fs::write(
        folder.join("other.toml"),
        SCENE.replace("-4, 3 km", "-4, 2 km"),
    )
    .unwrap();
    run(folder, "simulate other.toml -o b.cphd").succeeded();
    run(folder, "focus b.cphd --plan d/image.zarr/plan.json -o e")
        .failed(1, &["made for a recording of 300 pulses of 200 samples"]);
    assert!(!folder.join("e/image.zarr").exists());
    // Damaged tiles are reported when the picture is made.
    let tile = folder.join("d/image.zarr/c/0/0");
    let mut bytes = fs::read(&tile).unwrap();
    bytes[9] ^= 4;
    fs::write(&tile, bytes).unwrap();
    run(folder, "picture d -o d.png").failed(1, &["CRC-32", "--resume"]);
    fs::remove_file(folder.join("d/image.zarr/done/0.0.json")).unwrap();
    run(folder, &format!("focus a.cphd {grid} --resume -o d")).succeeded();
    assert!(store(&folder.join("d")) == before);
    run(folder, &format!("{line} --force -a bp")).succeeded();
    assert!(store(&folder.join("d")) != before);
}

#[test]
fn conflicting_options_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (line, part) in [
        ("focus a.cphd -o d --tiles 1/2", "--plan"),
        ("focus a.cphd -o d --plan p --tiles 3/2", "a part is wanted"),
        ("focus a.cphd -o d --plan p -a bp", "--algorithm"),
        ("focus a.cphd -o d --scratch 1M", "--tiled"),
        ("focus a.cphd -o d --tiled --scratch 1K", "at least 64K"),
        ("plan focus a.cphd -o p --velocity 1,2", "--velocity"),
    ] {
        run(folder, line).failed(2, &[part]);
    }
    fs::write(folder.join("p"), "{}").unwrap();
    run(folder, "focus a.cphd -o d --plan p").failed(1, &["a.cphd"]);
    recording(folder);
    run(folder, "focus a.cphd -o d --plan p").failed(1, &["p", "plan again"]);
    run(folder, "focus a.cphd -o d --plan none").failed(1, &["none"]);
}

/// A second run into a folder is refused while the first is running.
#[test]
fn two_runs_into_one_folder_exclude_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder);
    let line = "focus a.cphd -a exact --grid x=-60:60:0.5,y=-60:60:0.5 --tiled --resume -o d";
    let mut first = command(folder, line.split_whitespace())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !folder.join("d/image.zarr/zarr.json").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60));
        sleep(Duration::from_millis(5));
    }
    sleep(Duration::from_millis(100));
    let second = run(folder, line);
    let still = first.try_wait().unwrap().is_none();
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(still, "the first run ended too soon");
    second.failed(1, &["another run"]);
    // The lock of a dead run is removed.
    let bp = line.replace("exact", "bp");
    run(folder, &bp).failed(1, &["found another"]);
}

/// Without `--tiled` an image may be larger than memory too: the same bits in the same file.
#[test]
fn image_larger_than_memory_is_formed_into_one_array() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder);
    // 15 MB of pixels, of some 20 MB that 44 MB leave.
    for (former, side) in [("rdbp", 0.088), ("ffbp", 0.088)] {
        let line = format!(
            "focus a.cphd -a {former} --grid x=-60:60:{side},y=-60:60:{side} --threads 2 --force"
        );
        run(folder, &format!("{line} --memory 1G -o whole")).succeeded();
        let ran = run(folder, &format!("{line} --memory 44M -o little --check 50"));
        assert!(
            ran.succeeded()
                .contains("error against the exact sum on 50 pixels"),
            "{ran:?}"
        );
        let [whole, little] =
            ["whole", "little"].map(|name| fs::read(folder.join(name).join("image.npy")).unwrap());
        assert!(whole == little, "{former}");
        let said = run(folder, "picture little -o little.png --memory 44M");
        said.succeeded();
        let [whole, little] = ["whole", "little"].map(|name| record(&folder.join(name)));
        assert_eq!(whole["brightest"], little["brightest"]);
        assert_eq!(
            whole["settings"]["resolved"]["predicted_error_db"].is_number(),
            little["settings"]["resolved"]["predicted_error_db"].is_number()
        );
    }
}

fn record(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join("image.json")).unwrap()).unwrap()
}

/// A dark grid near a bright point, for which the first plan is insufficient, is planned again in tiles as in one piece, with and without a
/// kill.
#[test]
fn dark_tiled_image_is_planned_again_for_smaller_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("scene.toml"), BRIGHT).unwrap();
    run(folder, "simulate scene.toml -o a.cphd").succeeded();
    let line =
        "focus a.cphd -a ffbp --error-db -45 --grid x=10:58:0.3,y=-58:-10:0.3 --window taylor:25";
    run(folder, &format!("{line} -o once")).succeeded();
    let begun = Instant::now();
    run(folder, &format!("{line} --tiled -o whole --check 40")).succeeded();
    let took_ms = begun.elapsed().as_millis() as u64;
    let [once, whole] = ["once", "whole"].map(|name| record(&folder.join(name)));
    let resolved = &whole["settings"]["resolved"];
    let for_db = resolved["planned_for_db"].as_f64().unwrap();
    let expected = once["settings"]["resolved"]["planned_for_db"].as_f64();
    // The same sums in another order, dominated by scatterers outside the grid; the pixels drawn from tiles are others.
    assert!(
        (for_db - expected.unwrap()).abs() < 1e-3,
        "{for_db} {expected:?}"
    );
    assert!(for_db < -45.0 && resolved["predicted_error_db"].as_f64().unwrap() <= -45.0);
    let measured = &whole["check"]["relative_to_image_db"];
    assert!(measured.as_f64().unwrap() < -45.0, "{measured}");
    let plan = fs::read_to_string(folder.join("whole/image.zarr/plan.json")).unwrap();
    assert!(plan.contains("planned_for_db"));

    let expected = store(&folder.join("whole"));
    let line = format!("{line} --tiled --resume -o killed");
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..3 {
        let mut child = command(folder, line.split_whitespace())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        sleep(Duration::from_millis(random.next_u64() % (took_ms + 1)));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    run(folder, &line).succeeded();
    assert!(store(&folder.join("killed")) == expected);
    let hidden = fs::read_dir(folder.join("killed")).unwrap();
    assert_eq!(hidden.count(), 3, "temporary files are left");
    // A shared plan is not changed.
    run(
        folder,
        "focus a.cphd --plan whole/image.zarr/plan.json --tiles 1/2 -o half",
    )
    .succeeded();
}

/// A process that creates the tiles keeps others waiting while its disk is slow.
#[test]
fn plan_waits_for_tiles_that_another_process_creates() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), SCENE).unwrap();
    run(at, "simulate scene.toml -o scene.cphd").succeeded();
    run(
        at,
        "plan focus scene.cphd --grid x=-40:40:1,y=-40:40:1 -o plan.json",
    )
    .succeeded();
    fs::create_dir(at.join("large")).unwrap();
    let mut creating = OutputClaims::new::<&Path>(&[], false);
    let store = at.join("large/image.zarr");
    creating.folder(&store, ["zarr.json"]).unwrap();
    let waiting = command(
        at,
        ["focus", "scene.cphd", "--plan", "plan.json", "-o", "large"],
    )
    .stderr(Stdio::piped())
    .spawn()
    .unwrap();
    sleep(Duration::from_secs(1));
    assert!(!store.join("zarr.json").exists());
    drop(creating);
    let ended = waiting.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{errors}");
    assert!(at.join("large/image.json").exists(), "{errors}");
}
