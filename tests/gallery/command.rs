//! `subap reproduce`: output files, reuse of items, and display of the page in a browser.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::SystemTime;

use serde_json::Value;
use subaperture_tests::subap::run;

/// The quickest items: one without a picture, two with.
const QUICK: [&str; 3] = ["s-table-4-1", "s-2-2", "s-2-3"];

fn reproduce(folder: &Path) -> String {
    let only: String = QUICK.map(|id| format!(" --only {id}")).concat();
    run(folder, &format!("reproduce -o gallery{only}"))
        .succeeded()
        .to_owned()
}

/// Every file of the gallery except the page, which is always written again, with its time of modification.
fn written(folder: &Path) -> BTreeMap<PathBuf, SystemTime> {
    let entries = fs::read_dir(folder.join("gallery")).unwrap();
    entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| !path.ends_with("index.html"))
        .map(|path| (path.clone(), path.metadata().unwrap().modified().unwrap()))
        .collect()
}

fn pictures(folder: &Path) -> Vec<PathBuf> {
    let is_png = |path: &PathBuf| path.extension().is_some_and(|e| e == "png");
    written(folder).into_keys().filter(is_png).collect()
}

fn width(png: &Path) -> u32 {
    let file = std::io::BufReader::new(fs::File::open(png).unwrap());
    png::Decoder::new(file).read_info().unwrap().info().width
}

#[test]
fn reproduce_reuses_items_and_repairs_damaged_ones() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let said = reproduce(folder);
    assert!(said.contains("3 of 3 agree"), "{said}");

    for id in QUICK {
        let text = fs::read(folder.join(format!("gallery/{id}.json"))).unwrap();
        let json: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(json["agrees"], true, "{id}");
        let checks = json["finding"]["checks"].as_array().unwrap();
        assert!(!checks.is_empty() && checks.iter().all(|c| c["agrees"] == true));
    }
    let pictures = pictures(folder);
    assert_eq!(pictures.len(), 3, "{pictures:?}");
    assert!(pictures.iter().all(|png| width(png) > 300));
    let page = fs::read_to_string(folder.join("gallery/index.html")).unwrap();
    assert_eq!(page.matches("<img ").count(), 3);
    assert!(!page.contains("http") && !page.contains("<script"));

    // Images of an interrupted item at full scale may be there.
    fs::write(
        folder.join("gallery/.subap-unfinished-01234567.npy"),
        "image",
    )
    .unwrap();

    // A second run reuses every file.
    let first = written(folder);
    reproduce(folder);
    assert_eq!(written(folder), first);

    // A damaged picture is made again with the same bytes; other items are unchanged.
    let damaged = &pictures[0];
    let whole = fs::read(damaged).unwrap();
    let mut bytes = whole.clone();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(damaged, &bytes).unwrap();
    reproduce(folder);
    assert_eq!(fs::read(damaged).unwrap(), whole);
    let second = written(folder);
    let id = |path: &Path| path.file_name().unwrap().to_str().unwrap()[..5].to_owned();
    for (path, time) in &first {
        assert_eq!(second[path] == *time, id(path) != id(damaged), "{path:?}");
    }

    // So is a truncated text.
    let json = folder.join("gallery/s-table-4-1.json");
    let text = fs::read(&json).unwrap();
    fs::write(&json, &text[..text.len() / 2]).unwrap();
    reproduce(folder);
    assert_eq!(fs::read(&json).unwrap(), text);
}

#[test]
fn reproduce_lists_items_and_rejects_unknown_ones() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| run(folder.path(), line);
    let list = run("reproduce --list").succeeded().to_owned();
    for id in ["s-table-2-1", "s-4-5", "s-4-14", "s-table-5-1", "s-5-2"] {
        assert!(
            list.lines().any(|line| line.starts_with(id)),
            "{id}: {list}"
        );
    }
    assert_eq!(
        run("reproduce --list --only s-4-5")
            .succeeded()
            .lines()
            .count(),
        1
    );
    run("reproduce --only s-9-9").failed(2, &["--only s-9-9", "s-table-2-1", "s-4-5"]);
    run("reproduce --only s-2-3 --gotcha nowhere.mat").failed(1, &["nowhere.mat"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// The forecast at the thesis's own scale: two items have more work and memory, others do not change.
#[test]
fn full_scale_is_forecast_for_the_large_scene() {
    let folder = tempfile::tempdir().unwrap();
    let forecast = |line: &str| {
        let ran = run(
            folder.path(),
            &format!("reproduce --dry-run --json --only {line}"),
        );
        let json: Value = serde_json::from_str(ran.succeeded()).unwrap();
        let number = |key: &str| json[key].as_f64().unwrap();
        [
            number("time_s") / number("measured_s"),
            number("memory_bytes"),
        ]
    };
    for id in ["s-4-10", "s-4-11"] {
        let ([work, bytes], [full_work, full_bytes]) =
            (forecast(id), forecast(&format!("{id} --full")));
        assert!(full_work > 50.0 * work && full_bytes > 10.0 * bytes, "{id}");
    }
    let few = "reproduce --only s-4-11 --full --memory 2G -o gallery";
    run(folder.path(), few).failed(1, &["--full", "9.0 GiB", "2.0 GiB", "--memory"]);
    let [quick, full] = [forecast("s-2-3"), forecast("s-2-3 --full")];
    assert!((full[0] / quick[0] - 1.0).abs() < 1e-9 && full[1] == quick[1]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A browser on this machine.
fn browser() -> Option<&'static str> {
    let works = |name: &&str| {
        let mut command = Command::new(name);
        command.arg("--version").stdin(Stdio::null());
        command.output().is_ok_and(|output| output.status.success())
    };
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(works)
}

#[test]
fn browser_shows_all_pictures_without_network() {
    let Some(browser) = browser() else {
        println!("skipped: chromium not found");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    reproduce(folder);
    // A copy that reports the width of each picture in the browser; 0 if it cannot decode it.
    let page = fs::read_to_string(folder.join("gallery/index.html")).unwrap();
    let ask = "<script>addEventListener('load', () => { document.title = 'widths ' + \
               Array.from(document.images, (image) => image.naturalWidth).join(' ') })</script></body>";
    let asking = folder.join("asking.html");
    fs::write(&asking, page.replace("</body>", ask)).unwrap();

    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"])
        .args([
            "--host-resolver-rules=MAP * ~NOTFOUND",
            "--virtual-time-budget=5000",
        ])
        .arg(format!(
            "--user-data-dir={}",
            folder.join("browser").display()
        ))
        .arg(format!("file://{}", asking.display()))
        .stdin(Stdio::null())
        .output()
        .expect("the browser starts");
    let dom = String::from_utf8_lossy(&output.stdout);
    let report = dom
        .split_once("<title>widths ")
        .and_then(|(_, rest)| rest.split_once("</title>"))
        .unwrap_or_else(|| panic!("no title in the output of {browser}: {output:?}"));
    let mut shown: Vec<u32> = report.0.split(' ').map(|w| w.parse().unwrap()).collect();
    let mut expected: Vec<u32> = pictures(folder).iter().map(|png| width(png)).collect();
    shown.sort_unstable();
    expected.sort_unstable();
    assert_eq!(shown, expected);
}
