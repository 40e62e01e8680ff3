//! `subap run`: a pipeline runs all stages once; a changed stage is repeated with the stages that depend on it and no others; the report
//! shows the numbers of the records, needs no network, and fits screens.

mod interrupted;
mod track;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use subaperture::io::product;
use subaperture_tests::matlab;
use subaperture_tests::subap::{Ran, listing, run};

use crate::driver::Browser;

/// Three points on the Earth, under clutter too weak to matter.
const SCENE: &str = r#"
name = "three points"
seed = 5

[scene]
x = "-30, 30 m"
y = "-30, 30 m"
reference = "0, 0, 0 m"

[scene.origin]
latitude = "40 deg"
longitude = "-86 deg"

[[scene.point]]
position = "3, 4, 0 m"
[[scene.point]]
position = "-16, 12, 0 m"
cross_section = "-6 dBsm"
[[scene.point]]
position = "14, -13, 0 m"
cross_section = "-12 dBsm"

[radar]
kind = "ideal"
pulses = 200
pri = "6 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 128

[platform]
kind = "linear"
position = "0, -4, 3 km"
velocity = "100, 0, 0 m/s"
at = "middle"
"#;

const JOB: &str = r#"name = "A <small> job"

[input]
files = "../a.cphd"

[autofocus]
grid = "x=-24:24:0.4,y=-24:24:0.4"
rounds = 2

[grid]
pixels = "x=-30:30:0.2,y=-30:30:0.2"

[former]
algorithm = "bp"
error = "-50 dB"
window = "none"
slow_window = "none"

[quality]
points = 3

[products]
formats = ["sicd", "sidd", "cog", "kmz", "png"]
"#;

/// Files of the formats in [`JOB`].
const PRODUCTS: [&str; 8] = [
    "sicd.nitf",
    "sidd.nitf",
    "map.tif",
    "map.json",
    "map.kmz",
    "map.png",
    "map.pgw",
    "map.prj",
];

/// A folder with the recording, and pipelines in subfolders.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        fs::write(place.at().join("scene.toml"), SCENE).unwrap();
        run(place.at(), "simulate scene.toml -o a.cphd").succeeded();
        place
    }

    fn at(&self) -> &Path {
        self.0.path()
    }

    /// A subfolder `name` with a pipeline in it.
    fn job(&self, name: &str, text: &str) -> PathBuf {
        let folder = self.at().join(name);
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("job.toml"), text).unwrap();
        folder
    }
}

/// Names of the stages, and whether each was run.
fn stages(ran: &Ran) -> Vec<(String, bool)> {
    let printed: Value = serde_json::from_str(ran.succeeded()).unwrap();
    let stages = printed["stages"].as_array().unwrap().iter();
    stages
        .map(|stage| {
            let name = stage["stage"].as_str().unwrap().to_owned();
            (name, stage["done"].as_bool().unwrap())
        })
        .collect()
}

/// The stages that were run.
fn done(ran: &Ran) -> Vec<String> {
    let all = stages(ran).into_iter();
    all.filter(|(_, done)| *done)
        .map(|(name, _)| name)
        .collect()
}

fn record(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn example_is_valid_and_dry_run_writes_no_file() {
    let place = Place::new();
    let at = place.at();
    let example = run(at, "run --example");
    fs::write(at.join("job.toml"), example.succeeded()).unwrap();
    fs::rename(at.join("a.cphd"), at.join("recording.cphd")).unwrap();
    let keys = run(at, "run --keys");
    for header in [
        "[input]",
        "[track]",
        "[autofocus]",
        "[former]",
        "[products]",
    ] {
        assert!(keys.succeeded().contains(header), "{header}");
    }
    let before = listing(at);
    let printed = run(at, "run job.toml --dry-run");
    for part in [
        "focus", "check", "picture", "quality", "products", "to do", "memory", "disk",
    ] {
        assert!(
            printed.succeeded().contains(part),
            "{part}: {}",
            printed.stdout
        );
    }
    let printed = run(at, "run job.toml --dry-run --json");
    let printed: Value = serde_json::from_str(printed.succeeded()).unwrap();
    assert!(printed["time_s"].as_f64().unwrap() > 0.0, "{printed}");
    let forecast_bytes = printed["memory_bytes"].as_u64().unwrap();
    assert!(forecast_bytes > 1 << 20, "{printed}");
    assert_eq!(printed["stages"].as_array().unwrap().len(), 5, "{printed}");
    // Pictures of a small image need less than their budget, an eighth of the memory up to 64 MiB.
    for memory in ["256M", "1G"] {
        let printed = run(
            at,
            &format!("run job.toml --dry-run --json --memory {memory}"),
        );
        let printed: Value = serde_json::from_str(printed.succeeded()).unwrap();
        assert_eq!(
            printed["memory_bytes"], forecast_bytes,
            "{memory}: {printed}"
        );
    }
    assert_eq!(listing(at), before);
}

#[test]
fn pipeline_makes_all_outputs_and_report_shows_numbers_of_records() {
    let place = Place::new();
    let without = JOB.replace(
        "[autofocus]\ngrid = \"x=-24:24:0.4,y=-24:24:0.4\"\nrounds = 2\n",
        "",
    );
    let at = place.job("whole", &without);
    let ran = run(&at, "run job.toml");
    assert!(ran.succeeded().contains("job/report.html"));
    let out = at.join("job");
    for name in PRODUCTS
        .iter()
        .chain(&["report.html", "picture.png", "check.json", "image.json"])
    {
        assert!(out.join(name).is_file(), "{name}");
    }
    // Image and check equal those of `subap focus`.
    let line = "focus ../a.cphd -a bp --error-db -50 --window none --slow-window none \
                --grid x=-30:30:0.2,y=-30:30:0.2 --check 64 --out direct";
    run(&at, line).succeeded();
    let [own, direct] = ["job", "direct"].map(|name| product::read(&at.join(name)).unwrap());
    assert_eq!(own.image.pixels, direct.image.pixels);
    let (check, theirs) = (record(&out.join("check.json")), &direct.metadata["check"]);
    assert_eq!(check["num_pixels"], theirs["num_pixels"]);
    for key in ["relative_rms_db", "relative_to_image_db"] {
        // The image's power is summed over other parts: equal to the last digit.
        let [own, theirs] = [&check[key], &theirs[key]].map(|value| value.as_f64().unwrap());
        assert!((own - theirs).abs() < 1e-9, "{key}: {own} {theirs}");
    }
    let error_db = check["relative_to_image_db"].as_f64().unwrap();
    assert!(error_db < -50.0, "{check}");
    let html = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(html.contains(&format!("{error_db:.2} dB")), "{error_db}");

    // Points are at their positions, and measured as by `subap quality`.
    let points = record(&out.join("quality.json"));
    let points = points["points"].as_array().unwrap();
    let placed = [(3.0, 4.0), (-16.0, 12.0), (14.0, -13.0)];
    assert_eq!(points.len(), placed.len());
    for (point, (x, y)) in points.iter().zip(placed) {
        let position = &point["response"]["position_m"];
        let near = |k: usize, to: f64| (position[k].as_f64().unwrap() - to).abs() < 0.1;
        assert!(near(0, x) && near(1, y), "{position}");
        let measured = run(&at, &format!("quality job --json --at={x},{y}"));
        let measured: Value = serde_json::from_str(measured.succeeded()).unwrap();
        assert_eq!(measured["points"][0], *point);
        for cut in measured["points"][0]["response"]["cuts"]
            .as_array()
            .unwrap()
        {
            let number = |value: &Value, digits: usize| {
                let value = value.as_f64().unwrap();
                format!("{value:.digits$}")
            };
            let row = format!(
                "<td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
                cut["along"].as_str().unwrap(),
                number(&cut["width_3db"], 4),
                number(&cut["null_rule"]["pslr_db"], 2),
                number(&cut["null_rule"]["islr_db"], 2)
            );
            assert!(html.contains(&row), "{row}");
        }
    }

    // Products equal those of `subap export`, and are printed with sizes and checksums.
    run(&at, "export job --format kmz -o own.kmz").succeeded();
    assert_eq!(
        fs::read(at.join("own.kmz")).unwrap(),
        fs::read(out.join("map.kmz")).unwrap()
    );
    for name in PRODUCTS {
        let bytes = fs::read(out.join(name)).unwrap();
        let printed = format!(
            "<td>{}</td><td><code>{:08x}</code></td>",
            bytes.len(),
            crc32fast::hash(&bytes)
        );
        assert!(html.contains(&printed), "{name}");
    }
    assert!(html.contains("<h1>A &lt;small&gt; job</h1>"));
    assert!(!html.contains("http") && !html.contains("<script"));

    // No stage is run twice.
    let again = run(&at, "run job.toml --json");
    assert_eq!(done(&again), [""; 0]);
    assert_eq!(fs::read_to_string(out.join("report.html")).unwrap(), html);
}

#[test]
fn changed_stage_reruns_only_its_successors() {
    let place = Place::new();
    let at = place.job("changed", JOB);
    let all = [
        "autofocus",
        "focus",
        "check",
        "picture",
        "quality",
        "products",
        "report",
    ];
    let first = run(&at, "run job.toml --json");
    assert_eq!(done(&first), all);

    // Version 0.1.0 did not record the kinds of outputs; reused stages have the same. The report depends on all that the state records of them.
    let files = |ran: &Ran| -> Value {
        let printed: Value = serde_json::from_str(ran.succeeded()).unwrap();
        printed["files"].clone()
    };
    let mut state = record(&at.join("job/job.json"));
    for stage in state["stages"].as_object_mut().unwrap().values_mut() {
        for output in stage["outputs"].as_array_mut().unwrap() {
            assert!(output.as_object_mut().unwrap().remove("kind").is_some());
        }
    }
    fs::write(at.join("job/job.json"), state.to_string()).unwrap();
    let reused = run(&at, "run job.toml --json");
    assert_eq!(done(&reused), ["report"]);
    assert_eq!(files(&reused), files(&first));

    let cases: [(&str, &[&str]); 8] = [
        ("picture.remap=density", &["picture", "report"]),
        ("quality.points=1", &["quality", "report"]),
        ("check.pixels=32", &["check", "report"]),
        ("name=other", &["report"]),
        ("grid.pixels=x=-28:30:0.2,y=-30:30:0.2", &all[1..]),
        ("former.allow_error=true", &all[1..]),
        ("former.error=-45dB", &all),
        ("autofocus.rounds=1", &all),
    ];
    let mut line = "run job.toml --json".to_owned();
    for (set, expected) in cases {
        line += &format!(" --set {set}");
        let changed = run(&at, &line);
        assert_eq!(done(&changed), expected, "{set}");
        let printed: Value = serde_json::from_str(&changed.stdout).unwrap();
        let key = set.split_once('=').unwrap().0;
        let why: Vec<&str> = printed["stages"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|stage| stage["why"].as_str())
            .collect();
        assert!(why[0].starts_with(&format!("{key} was ")), "{why:?}");
    }
    assert!(at.join("job/quality/point-1-x.png").is_file());
    assert!(
        !at.join("job/quality/point-2-x.png").exists(),
        "of an earlier run"
    );

    // A lost output is made again, without others; so is a changed one.
    fs::remove_file(at.join("job/map.kmz")).unwrap();
    assert_eq!(done(&run(&at, &line)), ["products", "report"]);
    let tile = at.join("job/image.zarr/c/0/0");
    let image = fs::read(&tile).unwrap();
    fs::write(&tile, vec![1; image.len()]).unwrap();
    assert_eq!(done(&run(&at, &line)), ["focus", "report"]);
    assert_eq!(fs::read(&tile).unwrap(), image);

    // Fewer formats leave fewer files; a stage that is removed is deleted with all its files.
    line += " --set products.formats=cog --set check.pixels=0";
    assert_eq!(done(&run(&at, &line)), ["products", "report"]);
    for name in ["sicd.nitf", "map.kmz", "map.png", "map.prj", "check.json"] {
        assert!(!at.join("job").join(name).exists(), "{name}");
    }
    assert!(at.join("job/map.tif").is_file());
    // Another recording makes another pipeline.
    run(
        place.at(),
        "simulate scene.toml --set seed=6 --set radar.pulses=198 -o a.cphd --force",
    )
    .succeeded();
    let other = run(&at, &line);
    assert_eq!(done(&other)[..2], ["autofocus", "focus"]);
    assert!(
        other.stdout.contains("input files have changed"),
        "{}",
        other.stdout
    );
}

#[test]
fn pipeline_faults_are_shown_in_place_and_no_stage_runs() {
    let place = Place::new();
    let at = place.at();
    let input = "[input]\nfiles = \"a.cphd\"\n";
    for (text, parts) in [
        (
            "[input]\nfile = \"a.cphd\"\n",
            &["job.toml:2:1", "did you mean 'files'", "^^^^"][..],
        ),
        (
            &format!("{input}[former]\nalgoritm = \"bp\"\n"),
            &["job.toml:4:1", "did you mean 'algorithm'"],
        ),
        (
            &format!("{input}[former]\nwindow = \"blackman\"\n"),
            &["job.toml:4:10", "window 'blackman'", "^^^^^^^^^^"],
        ),
        (
            &format!("{input}[grid]\npixels = \"x=1\"\nsurface = \"sea\"\n"),
            &["job.toml:4:10", "job.toml:5:11", "dem:FILE"],
        ),
        (
            &format!("{input}[products]\nplace = \"north\"\n"),
            &["job.toml:4:9", "latitude and longitude"],
        ),
        (
            &format!("{input}[products]\nformats = [\"nitf\"]\n"),
            &["job.toml:4:12", "'formats': unknown value \"nitf\""],
        ),
        (
            &format!("{input}[track]\nsource = \"mpga\"\n[autofocus]\n"),
            &["job.toml:5:1", "leave one of the two out"],
        ),
        ("[input\n", &["job.toml:1"]),
    ] {
        fs::write(at.join("job.toml"), text).unwrap();
        let before = listing(at);
        run(at, "run job.toml").failed(1, parts);
        assert_eq!(listing(at), before, "{text}");
    }
    fs::write(at.join("job.toml"), input).unwrap();
    run(at, "run job.toml --set former.eror=-40dB")
        .failed(1, &["--set former.eror", "former.error"]);
    run(at, "run none.toml").failed(1, &["cannot read none.toml"]);
    run(at, "run").failed(2, &["JOB"]);
    // Missing recordings, and one whose scene has no position on the Earth.
    let before = listing(at);
    run(at, "run job.toml --set input.files=b.cphd").failed(1, &["b.cphd"]);
    assert_eq!(listing(at), before);
    fs::write(at.join("a.mat"), matlab::gotcha(matlab::gotcha_fields())).unwrap();
    let input = "[input]\nfiles = \"a.mat\"\n[products]\nformats = \"kmz\"\n";
    fs::write(at.join("job.toml"), input).unwrap();
    let before = listing(at);
    run(at, "run job.toml").failed(1, &["job.toml:4:11", "place = "]);
    assert_eq!(listing(at), before);
}

#[test]
fn image_by_another_run_is_not_replaced() {
    let place = Place::new();
    let at = place.job("others", JOB);
    run(
        &at,
        "focus ../a.cphd --tiled --grid x=-5:5:0.5,y=-5:5:0.5 --out job",
    )
    .succeeded();
    let before = listing(&at);
    run(&at, "run job.toml").failed(1, &["this image was not formed by a job"]);
    assert_eq!(listing(&at), before);
    run(&at, "run job.toml --force").succeeded();
    // An invalid state file is an error.
    fs::write(at.join("job/job.json"), "{\"schema\":\"subaperture-job\"").unwrap();
    run(&at, "run job.toml").failed(1, &["job.json", "not a valid state of a job"]);
    // Other files in the folder remain.
    fs::write(at.join("job/job.json"), "{}").unwrap();
    run(&at, "run job.toml").failed(1, &["job.json"]);
}

/// The report in a browser without network: complete and without errors, on wide and narrow screens, in light and dark mode.
///
/// `SUBAPERTURE_SCREENSHOTS=FOLDER` keeps screenshots, as base64 of PNG.
#[test]
fn report_needs_no_network_and_fits_screens() {
    let place = Place::new();
    let at = place.job("shown", JOB);
    run(&at, "run job.toml").succeeded();
    let Some(browser) = Browser::start(1280, 900) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    browser.command("Network.enable", &json!({}));
    let offline =
        json!({ "offline": true, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0 });
    browser.command("Network.emulateNetworkConditions", &offline);
    let page = at.join("job/report.html");
    for (name, width, scheme) in [("wide", 1280, "light"), ("phone", 390, "dark")] {
        let size =
            json!({ "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600 });
        browser.command("Emulation.setDeviceMetricsOverride", &size);
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        browser.command("Emulation.setEmulatedMedia", &media);
        browser.open(&format!("file://{}", page.display()));
        browser.wait("document.readyState === 'complete'");
        let whole =
            "return [...document.images].filter(i => i.complete && i.naturalWidth > 100).length";
        // The picture, three points with two cuts and a chip each, autofocus.
        assert_eq!(browser.run(whole), 11, "{name}");
        assert_eq!(browser.run("return document.images.length"), 11);
        let asked = "return performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length";
        assert_eq!(browser.run(asked), 0, "{name}");
        assert_eq!(
            browser.run("return document.querySelector('h1').textContent"),
            "A <small> job"
        );
        let wider =
            "return document.documentElement.scrollWidth - document.documentElement.clientWidth";
        assert_eq!(browser.run(wider), 0, "{name}: wider than the screen");
        let paper = browser.run("return getComputedStyle(document.body).backgroundColor");
        assert_eq!(
            paper == "rgb(255, 255, 255)",
            scheme == "light",
            "{name}: {paper}"
        );
        let said = browser.console();
        assert!(said.is_empty(), "{name}: {said:?}");
        if let Ok(folder) = std::env::var("SUBAPERTURE_SCREENSHOTS") {
            fs::write(
                format!("{folder}/report-{name}.base64"),
                browser.screenshot(),
            )
            .unwrap();
        }
    }
    // Errors of a page are detected.
    fs::write(
        at.join("bad.html"),
        "<img src=\"none.png\"><script>nothing()</script>",
    )
    .unwrap();
    browser.open(&format!("file://{}", at.join("bad.html").display()));
    browser.wait("document.readyState === 'complete'");
    assert!(!browser.console().is_empty());
}
