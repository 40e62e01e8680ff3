//! `subap view`: inputs, refusals, responses, and termination. The page itself is tested in `host/viewer/tests/images.rs`.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use subaperture_tests::subap::{command, folder_with_recording, listing, run, write_recording};

/// A running viewer, killed if a test fails.
struct Served {
    child: Child,
    address: String,
    /// First component of all paths.
    secret: String,
}

impl Served {
    fn begin(folder: &Path, line: &str) -> Self {
        let mut command = command(folder, line.split_whitespace());
        command.stderr(Stdio::null());
        Self::of(command)
    }

    fn of(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut url = String::new();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        lines.read_line(&mut url).unwrap();
        let address = url.trim().strip_prefix("http://").unwrap_or_default();
        let (address, secret) = address.trim_end_matches('/').split_once('/').unwrap();
        Self {
            address: address.to_owned(),
            secret: format!("/{secret}"),
            child,
        }
    }

    fn ask(&self, path: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        write!(
            stream,
            "GET {}{path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
            self.secret, self.address
        )
        .unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        String::from_utf8_lossy(&all[end + 4..]).into_owned()
    }

    fn state(&self) -> Value {
        serde_json::from_str(&self.ask("/state")).unwrap()
    }

    fn settled(&self) -> Value {
        let begun = Instant::now();
        loop {
            let state = self.state();
            let images = state["images"].as_array().unwrap();
            if images.iter().all(|image| image["settled"] == true) {
                return state;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "{state}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// End it by a signal; returns the status and the time until the end.
    fn end(mut self, signal: &str) -> (Option<i32>, Duration) {
        let begun = Instant::now();
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status().unwrap();
        assert!(sent.success());
        (self.child.wait().unwrap().code(), begun.elapsed())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A product of few pixels, with layers.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o table.cphd").succeeded();
    run(
        at,
        "focus table.cphd --grid x=-6:6:0.1,y=-5:5:0.1 --out image",
    )
    .succeeded();
    fs::write(
        at.join("track.csv"),
        "time_s,x_m,y_m,z_m\n0,0,0,0\n1,2,3,0\n",
    )
    .unwrap();
    fs::write(
        at.join("marks.geojson"),
        r#"{"type":"Point","coordinates":[0,0]}"#,
    )
    .unwrap();
    folder
}

#[test]
fn product_is_served_with_its_layers_until_a_signal() {
    let folder = folder();
    let at = folder.path();
    let before = listing(at);
    let line = "view image image/image.npy --layer track.csv --layer marks.geojson";
    let served = Served::begin(at, line);
    assert!(
        served.address.starts_with("127.0.0.1:"),
        "{}",
        served.address
    );
    let state = served.settled();
    let [product, array] = [0, 1].map(|i| &state["images"][i]);
    assert_eq!(
        (&product["rows"], &product["columns"]),
        (&100.into(), &120.into())
    );
    assert_eq!(product["steps_m"], serde_json::json!([0.1, 0.1]));
    assert_eq!(product["aperture"], true);
    assert!(array["steps_m"].is_null() && array["fault"].is_null());
    // The track begins at the scene's middle, row 50 and column 60, and goes 3 m up and 2 m to the right.
    let track: Value = serde_json::from_str(&served.ask("/layer/0/0")).unwrap();
    let places = &track["features"][0]["shapes"][0]["places"];
    let place = |i: usize, k: usize| places[i][k].as_f64().unwrap();
    for (i, expected) in [[50.0, 60.0], [80.0, 80.0]].into_iter().enumerate() {
        assert!(
            (place(i, 0) - expected[0]).abs() < 1e-6 && (place(i, 1) - expected[1]).abs() < 1e-6
        );
    }
    // The point in the middle: a unit scatterer with the radar's resolution.
    let point: Value = serde_json::from_str(&served.ask("/point/0/50/60/4")).unwrap();
    assert!(point["level_db"].as_f64().unwrap().abs() < 0.2, "{point}");
    assert!(point["cuts"][0]["width_3db"].as_f64().unwrap() > 0.1);
    // From half of the aperture: all cells of the image have a level.
    let half = served.ask("/look/0/0/500/0/0/0");
    assert!(half.len() > 100_000 && served.ask("/look/1/0/500/0/0/0").contains("no such"));
    for signal in ["-INT", "-TERM"] {
        let served = Served::begin(at, "view image");
        let (code, took) = served.end(signal);
        // The viewer ends within a second, after its responses; the machine may be busy. Without a signal it never ends.
        assert!(
            code == Some(0) && took < Duration::from_secs(20),
            "{code:?} {took:?}"
        );
    }
    assert_eq!(listing(at), before);
}

/// The look arrow of a product follows its record's azimuth. Rows of its SICD run away from the radar, whose position the SICD states. North arrows are the gradients
/// of the latitudes of pixels. Both images lie in the ground plane.
#[test]
fn arrows_follow_the_records_of_a_product_and_its_sicd() {
    let folder = folder();
    let at = folder.path();
    run(at, "export image --format sicd -o image.nitf").succeeded();
    let record = fs::read(at.join("image/image.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    let azimuth_deg = record["collection"]["azimuth_deg"].as_f64().unwrap();
    let served = Served::begin(at, "view image image.nitf");
    let state = served.settled();
    let number = |value: &Value| value.as_f64().unwrap();
    let axes = |i: usize| &state["images"][i]["axes"];
    // Degrees from ascending columns towards ascending rows.
    let angle = |direction: &Value| {
        number(&direction[0])
            .atan2(number(&direction[1]))
            .to_degrees()
    };
    // The azimuth points from the scene to the antenna. An image of 12 m, seen from its centre, has the direction of its record to a degree.
    for (i, expected) in [(0, azimuth_deg + 180.0), (1, 90.0)] {
        let off = (angle(&axes(i)["look"]) - expected) / 360.0;
        assert!((off - off.round()).abs() * 360.0 < 1.0, "{i}: {}", axes(i));
        assert!(number(&axes(i)["tilt_deg"]) < 0.01, "{}", axes(i));
    }
    let latitude_deg = |i: usize, row: usize, column: usize| {
        let value = served.ask(&format!("/value/{i}/{row}/{column}"));
        let value: Value = serde_json::from_str(&value).unwrap();
        number(&value["latitude_deg"])
    };
    for i in 0..2 {
        let step_m = |k: usize| number(&state["images"][i]["steps_m"][k]);
        let middle = latitude_deg(i, 40, 40);
        let along = [
            (latitude_deg(i, 80, 40) - middle) / step_m(0),
            (latitude_deg(i, 40, 80) - middle) / step_m(1),
        ];
        let expected = along[0].atan2(along[1]).to_degrees();
        let off = (angle(&axes(i)["north"]) - expected) / 360.0;
        // Latitudes have 1e-9 m of roundings, over 4 m.
        assert!(
            (off - off.round()).abs() * 360.0 < 0.01,
            "{i}: {along:?} {}",
            axes(i)
        );
    }
}

/// A single point, so that its maps contain nothing else.
const ALONE: &str = r#"[scene]
reference = "0, 0, 0 m"
x = "-10, 10 m"
y = "-10, 10 m"

[[scene.point]]
position = "0, 0, 0 m"

[radar]
kind = "ideal"
pulses = 128
pri = "1 ms"
centre = "10 GHz"
bandwidth = "200 MHz"
samples = 128

[platform]
kind = "linear"
position = "0, -4, 3 km"
velocity = "125, 0, 0 m/s"
"#;

/// Maps of a recording about its point: the peak is at the bin of the position, and a unit scatterer has 0 dB.
#[test]
fn range_doppler_maps_of_a_recording_are_shown() {
    let folder = folder_with_recording("alone", ALONE);
    let at = folder.path();
    run(
        at,
        "focus alone.cphd --grid x=-6:6:0.1,y=-5:5:0.1 --out image",
    )
    .succeeded();
    let served = Served::begin(at, "view image --maps alone.cphd --sub-cpi 32");
    let state = served.settled();
    assert_eq!(state["maps"][0]["name"], "alone.cphd");
    let sub_cpis = state["maps"][0]["sub_cpis"].as_u64().unwrap();
    assert!(sub_cpis >= 2, "{state}");
    // Offset of the largest level from the position's bin (row, column, in map units), and that level.
    let peak = |path: &str| {
        let response: Value = serde_json::from_str(&served.ask(path)).unwrap();
        let levels = response["levels"].as_array().unwrap();
        let level = |i: &usize| levels[*i].as_i64().unwrap();
        let at = (0..levels.len()).max_by_key(level).unwrap();
        let columns = response["columns"].as_u64().unwrap() as usize;
        assert_eq!(
            levels.len(),
            columns * response["rows"].as_u64().unwrap() as usize
        );
        let number = |key: &str, i: usize| response[key][i].as_f64().unwrap();
        let axis = |i: usize, bin: usize| number("first", i) + bin as f64 * number("steps", i);
        ([axis(0, at / columns), axis(1, at % columns)], level(&at))
    };
    let (place, level) = peak("/doppler/0/0/0/50/60");
    // The neighbouring bins are empty, and rounding of a bin is a tenth of a decibel.
    assert!(place[0].abs() < 1e-9 && place[1].abs() < 1e-9, "{place:?}");
    assert!(level.abs() <= 1, "{level}");
    for path in [
        "/doppler/1/0/0/50/60",
        "/doppler/0/99999/0/50/60",
        "/doppler/0/0/0/100/0",
    ] {
        assert!(served.ask(path).contains("no such"), "{path}");
    }
}

#[test]
fn record_of_another_image_is_reported_on_the_page() {
    let folder = folder();
    let path = folder.path().join("image/image.npy");
    let mut bytes = fs::read(&path).unwrap();
    bytes[5000] ^= 1;
    fs::write(&path, bytes).unwrap();
    let served = Served::begin(folder.path(), "view image");
    let state = served.settled();
    let fault = state["images"][0]["fault"].as_str().unwrap();
    assert!(
        fault.contains("CRC-32") && fault.contains("form it again"),
        "{fault}"
    );
}

/// A store that other processes fill: its plan states the geometry, and tiles appear as they are written.
#[test]
fn image_still_being_formed_in_tiles_is_shown() {
    let folder = folder();
    let at = folder.path();
    run(
        at,
        "plan focus table.cphd -a bp --grid x=-20:20:0.1,y=-20:20:0.1 -o plan.json",
    )
    .succeeded();
    run(at, "focus table.cphd --plan plan.json --tiles 1/2 -o grown").succeeded();
    let served = Served::begin(at, "view grown");
    let begun = Instant::now();
    while served.state()["images"][0]["ready"] != true {
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(30));
    }
    let image = &served.state()["images"][0];
    assert_eq!(image["steps_m"], serde_json::json!([0.1, 0.1]));
    let fraction = image["fraction"].as_f64().unwrap();
    assert!(
        image["settled"] == false && fraction > 0.2 && fraction < 0.8,
        "{image}"
    );
    run(at, "focus table.cphd --plan plan.json --tiles 2/2 -o grown").succeeded();
    let state = served.settled();
    assert_eq!(state["images"][0]["fraction"].as_f64(), Some(1.0));
}

/// An image of 6000 x 6000 pixels, 288 MB, within little memory: 16 MiB plus 1 per thread for the program by its own account, 5 for
/// overview and preview, two requests of a few MiB each; the rest is kept by the allocator.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_independent_of_image_size() {
    let folder = tempfile::tempdir().unwrap();
    let header = "{'descr': '<c8', 'fortran_order': False, 'shape': (6000, 6000), }";
    let mut file = File::create(folder.path().join("large.npy")).unwrap();
    file.write_all(b"\x93NUMPY\x01\x00\x76\x00").unwrap();
    writeln!(file, "{header:<117}").unwrap();
    file.set_len(128 + 8 * 6000 * 6000).unwrap();
    drop(file);
    let served = Served::begin(folder.path(), "view large.npy --memory 100M --threads 2");
    served.settled();
    for level in 0..=5 {
        for at in 0..3 {
            served.ask(&format!("/tile/0/{level}/{at}/{at}"));
        }
    }
    served.ask("/cut/0/0/0/5999/5999");
    let status = fs::read_to_string(format!("/proc/{}/status", served.child.id())).unwrap();
    let line = status
        .lines()
        .find(|line| line.starts_with("VmHWM:"))
        .unwrap();
    let kib: u64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    println!("{kib} KiB at the most");
    assert!(kib < 80 << 10, "{line}");
}

/// Fifty simultaneous clients, each with requests of every kind, on images in one array and in tiles, within 64 MiB and within the smallest
/// accepted budget.
#[cfg(target_os = "linux")]
#[test]
fn memory_holds_under_fifty_clients() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o table.cphd").succeeded();
    let grid = "--grid x=-6:6:0.006,y=-5:5:0.006 -a ffbp --allow-error";
    run(at, &format!("focus table.cphd {grid} -o image"));
    run(at, &format!("focus table.cphd {grid} --tiled -o tiled"));
    let view = "view image tiled --maps table.cphd --threads 2 --memory";
    run(at, &format!("{view} 28M")).failed(1, &["at least", "found 28.0 MiB", "--memory"]);
    for mib in [31, 64] {
        let line = format!("{view} {mib}M");
        let served = Served::begin(at, &line);
        served.settled();
        std::thread::scope(|scope| {
            for client in 0..50 {
                let served = &served;
                scope.spawn(move || {
                    for n in 0..12 {
                        let image = (client + n) % 2;
                        let path = match (client + n) % 8 {
                            0 => format!("/tile/{image}/3/0/0"),
                            1 => format!("/tile/{image}/{}/{}/1", n % 3, client % 3),
                            2 => format!("/phase/{image}/{}/2", client % 5),
                            3 => format!("/point/{image}/833/1000/20"),
                            4 => format!("/look/{image}/0/500/1/1/1"),
                            5 => format!("/doppler/0/{n}/{image}/800/900"),
                            6 => format!("/statistics/{image}/100/{n}/900/1900"),
                            _ => format!("/cut/{image}/0/0/1600/1900"),
                        };
                        served.ask(&path);
                    }
                });
            }
        });
        let peak = crate::memory::peak_of(served.child.id()).unwrap();
        println!("{mib} MiB: {peak:.1} MiB at the most");
        assert!(peak <= f64::from(mib), "{peak} MiB of {mib}");
    }
}

/// Maps of 4096 pulses x 256 samples need 8 MB of samples, and twice as many bins along both axes.
#[test]
fn range_doppler_maps_larger_than_memory_are_refused() {
    let folder = folder();
    let at = folder.path();
    let scenario = crate::memory::SCENARIO
        .replace("pulses = 16", "pulses = 4096")
        .replace("10 ms", "100 us")
        .replace("samples = 64", "samples = 256");
    write_recording(at, "long", scenario);
    let line = "view image --maps long.cphd --sub-cpi 4096 --threads 2 --memory";
    run(at, &format!("{line} 64M")).failed(1, &["range-Doppler map", "--sub-cpi", "--memory"]);
    let served = Served::begin(at, &format!("{line} 256M"));
    served.settled();
    let map = served.ask("/doppler/0/0/0/1/1");
    assert!(
        map.contains("\"pulses\":4096"),
        "{}",
        &map[..map.len().min(300)]
    );
    #[cfg(target_os = "linux")]
    {
        let peak_mib = crate::memory::peak_of(served.child.id()).unwrap();
        println!("{peak_mib:.1} MiB at the most");
        assert!(peak_mib <= 256.0, "{peak_mib} MiB of 256");
    }
}

/// More slow clients than connections allowed, each of which begins a request and never ends it.
#[test]
fn slow_clients_do_not_close_the_viewer() {
    let folder = folder();
    let served = Served::begin(folder.path(), "view image");
    let mut slow = Vec::new();
    for _ in 0..100 {
        let mut stream = TcpStream::connect(&served.address).unwrap();
        stream
            .write_all(b"GET /state HTTP/1.1\r\nHost: loc")
            .unwrap();
        slow.push(stream);
    }
    assert_eq!(served.settled()["images"][0]["name"], "image");
}

/// `--open` runs the system's opener with the printed URL. If the opener fails or is missing, the page is served with a warning.
#[cfg(target_os = "linux")]
#[test]
fn open_starts_the_default_browser() {
    use std::os::unix::fs::PermissionsExt;

    let folder = folder();
    let at = folder.path();
    let opener = at.join("bin/xdg-open");
    fs::create_dir(at.join("bin")).unwrap();
    let served = |script: Option<&str>| {
        match script {
            Some(script) => {
                fs::write(&opener, format!("#!/bin/sh\n{script}\n")).unwrap();
                fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
            }
            None => fs::remove_file(&opener).unwrap(),
        }
        let mut command = command(at, ["view", "image", "--open"]);
        command.env("PATH", at.join("bin")).stderr(Stdio::piped());
        Served::of(command)
    };
    let recorded = at.join("url");
    let script = format!(
        "echo \"$@\" > {0}.new && /bin/mv {0}.new {0}",
        recorded.display()
    );
    let shown = served(Some(&script));
    let begun = Instant::now();
    while !recorded.exists() {
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(20));
    }
    let url = format!("http://{}{}/\n", shown.address, shown.secret);
    assert_eq!(fs::read_to_string(&recorded).unwrap(), url);
    drop(shown);
    for (script, reason) in [
        (Some("exit 3"), "exit status: 3"),
        (None, "cannot run xdg-open"),
    ] {
        let mut shown = served(script);
        let stderr = BufReader::new(shown.child.stderr.take().unwrap());
        let mut lines = stderr.lines().map_while(Result::ok);
        let warning = lines.find(|line| line.contains("--open")).unwrap();
        assert!(
            warning.contains("warning") && warning.contains(reason),
            "{warning}"
        );
        assert_eq!(shown.settled()["images"][0]["name"], "image");
        let (code, _) = shown.end("-INT");
        assert_eq!(code, Some(0));
    }
}

/// Other users of this machine can reach the port, but see no data without the secret.
#[test]
fn requests_without_secret_are_refused() {
    let folder = folder();
    let mut served = Served::begin(folder.path(), "view image");
    served.settled();
    let secret = std::mem::take(&mut served.secret);
    for path in ["/", "/state", "/tile/0/0/0/0", "/value/0/1/1"] {
        let response = served.ask(path);
        assert!(
            response.contains("whole address") && response.len() < 200,
            "{path}: {response}"
        );
    }
    let again = Served::begin(folder.path(), "view image");
    assert!(secret.len() > 16 && again.secret != secret);
}

#[test]
fn unsupported_inputs_are_refused() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("bad.geojson"), "{}").unwrap();
    fs::write(at.join("bad.csv"), "time_s\n").unwrap();
    fs::create_dir(at.join("empty")).unwrap();
    for (line, code, parts) in [
        ("view", 2, &["IMAGE"][..]),
        ("view nowhere", 1, &["nowhere"]),
        ("view empty", 1, &["empty", "image.json"]),
        ("view table.cphd", 1, &["table.cphd", "expected an image"]),
        (
            "view image --layer nowhere.geojson",
            1,
            &["nowhere.geojson", "cannot read"],
        ),
        (
            "view image --layer bad.geojson",
            1,
            &["bad.geojson", "not GeoJSON"],
        ),
        ("view image --layer bad.csv", 1, &["bad.csv, line 1"]),
        ("view image --maps nowhere.cphd", 1, &["nowhere.cphd"]),
        ("view image --maps marks.geojson", 1, &["marks.geojson"]),
        ("view image --port 99999", 2, &["--port"]),
        ("view image --port 1 --listen 127.0.0.1:1", 2, &["--listen"]),
        (
            "view image --listen 192.0.2.1:80",
            1,
            &["cannot listen at 192.0.2.1:80"],
        ),
    ] {
        run(at, line).failed(code, parts);
    }
    // Two viewers at one port: the second one reports an error.
    let served = Served::begin(at, "view image");
    let port = served.address.rsplit_once(':').unwrap().1;
    run(at, &format!("view image --port {port}")).failed(1, &["cannot listen", port]);
}
