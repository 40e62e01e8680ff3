//! Descriptions of raw recordings through the command: settings, files written by `tune`, and errors.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use subaperture::io::npy;
use subaperture_tests::numpy;
use subaperture_tests::subap::{command, run};

/// A 24 GHz sweep on a rail of 1.2 m past three points.
const SCENE: &str = r#"name = "rail"

[radar]
kind = "fmcw"
pulses = 81
pri = "10 ms"
centre = "24 GHz"
bandwidth = "1 GHz"
samples = 128
sample_rate = "1 MHz"

[platform]
kind = "rail"
from = "-0.6, 0, 0 m"
to = "0.6, 0, 0 m"
speed = "1.5 m/s"

[scene]
reference = "0, 4, 0 m"

[[scene.point]]
position = "0.4, 3.6, 0 m"
[[scene.point]]
position = "-0.5, 4.2, 0 m"
[[scene.point]]
position = "0.1, 4.7, 0 m"
"#;

/// A folder with the scenario and its echoes as `raw/recording.toml`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let line = "simulate scene.toml --echoes raw -o scene.cphd -q";
    run(folder.path(), line).succeeded();
    folder
}

/// Replace `from`, which occurs once, by `to`.
fn change(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert_eq!(text.matches(from).count(), 1, "{from} in {text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn scene_without_extent_is_simulated_and_every_command_accepts_settings() {
    let folder = folder();
    let at = folder.path();
    let bias = "--set recording.range_bias=0.5m";
    let grid = "--grid x=-1:1:0.05,y=3:6:0.05 --algorithm bp -q";
    run(at, &format!("focus raw/recording.toml --out plain {grid}")).succeeded();
    run(
        at,
        &format!("focus raw/recording.toml --out set {grid} {bias}"),
    )
    .succeeded();
    let text = fs::read_to_string(at.join("raw/recording.toml")).unwrap();
    let biased = text.replace("[recording]\n", "[recording]\nrange_bias = \"0.5 m\"\n");
    fs::write(at.join("raw/biased.toml"), biased).unwrap();
    run(at, &format!("focus raw/biased.toml --out written {grid}")).succeeded();
    let image = |name: &str| npy::read(&at.join(name).join("image.npy")).unwrap();
    // A setting has the same effect as the line in the file, to the bit.
    assert_eq!(image("set").pixels, image("written").pixels);
    assert_ne!(image("set").pixels, image("plain").pixels);
    let record = fs::read_to_string(at.join("set/image.json")).unwrap();
    assert!(record.contains("recording.range_bias=0.5m"), "{record}");

    let half = run(at, "info raw/recording.toml --set recording.count=40");
    assert!(half.succeeded().contains("40 pulses"), "{half:?}");
    run(at, "info scene.cphd --set recording.count=40")
        .failed(1, &["scene.cphd", "recording.count", ".toml"]);
    run(at, "plan module raw/recording.toml --ram 512K --set recording.count=80 --grid x=-1:1:0.1,y=3:5:0.1 -q")
        .succeeded();
}

#[test]
fn tune_writes_only_tuned_values() {
    let folder = folder();
    let at = folder.path();
    let path = at.join("raw/recording.toml");
    change(
        &path,
        "[recording]\n",
        "# found later\n[recording]  # raw\n",
    );
    let before = fs::read_to_string(&path).unwrap();
    let tune = "tune raw/recording.toml --vary recording.range_bias=-0.3:0.3:0.05m --refine 3 --at 0.4,3.6 --at 0.1,4.7";

    let alone = run(at, tune);
    assert!(alone.succeeded().contains("--write"), "{alone:?}");
    assert!(
        alone.stdout.contains("--set recording.range_bias=\""),
        "{alone:?}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), before);

    run(at, &format!("{tune} --write-to raw/tuned.toml")).succeeded();
    assert_eq!(fs::read_to_string(&path).unwrap(), before);
    let tuned = fs::read_to_string(at.join("raw/tuned.toml")).unwrap();
    let added: Vec<&str> = tuned
        .lines()
        .filter(|line| !before.contains(line))
        .collect();
    assert!(
        matches!(added[..], [line] if line.starts_with("range_bias = \"")),
        "{added:?}"
    );
    assert_eq!(tuned.lines().count(), before.lines().count() + 1);
    run(at, "info raw/tuned.toml").succeeded();

    run(at, &format!("{tune} --write")).succeeded();
    assert_eq!(fs::read_to_string(&path).unwrap(), tuned);
    // The second time the line exists and gets the value.
    run(at, &format!("{tune} --write")).succeeded();
    assert_eq!(fs::read_to_string(&path).unwrap(), tuned);

    run(at, &format!("{tune} --write-to raw/tuned.toml"))
        .failed(2, &["--write-to", "the file exists"]);
    run(at, &format!("{tune} --write-to other.toml")).failed(2, &["in the folder of"]);
}

#[test]
fn tune_writes_no_value_whose_error_is_unknown() {
    let folder = folder();
    let at = folder.path();
    let path = at.join("raw/recording.toml");
    let before = fs::read(&path).unwrap();
    let wide = "-0.3:0.3:0.05m";
    for (interval, options, verdict) in [
        // An error is stated for at least three values, and at least two pulses in each of eight parts of the aperture.
        ("0:0.05:0.05m", "", "error unknown"),
        (wide, "--set recording.count=15", "error unknown"),
        // An optimum at an end of the interval has no error either.
        ("0.1:0.3:0.05m", "", "at an end"),
    ] {
        let tune = format!(
            "tune raw/recording.toml --vary recording.range_bias={interval} --refine 1 --at 0.4,3.6 --at 0.1,4.7 {options}"
        );
        let alone = run(at, &tune);
        assert!(alone.succeeded().contains(verdict), "{alone:?}");
        for write in ["--write", "--write-to raw/tuned.toml", "--write --json"] {
            let ran = run(at, &format!("{tune} {write}"));
            ran.failed(
                1,
                &["recording.range_bias: expected a value that the data determine"],
            );
            assert_eq!(fs::read(&path).unwrap(), before, "{ran:?}");
            assert!(!at.join("raw/tuned.toml").exists(), "{ran:?}");
        }
    }
    // The same search with enough values and pulses is written.
    run(
        at,
        &format!("tune raw/recording.toml --vary recording.range_bias={wide} --refine 1 --at 0.4,3.6 --at 0.1,4.7 --write"),
    )
    .succeeded();
    assert_ne!(fs::read(&path).unwrap(), before);
}

#[test]
fn description_errors_state_the_expected_value() {
    let folder = folder();
    let at = folder.path();
    let info = |setting: &str| run(at, &format!("info raw/recording.toml --set {setting}"));
    // No suggestion where no key is similar.
    let far = info("radar.foo=3");
    far.failed(1, &["unknown key 'radar.foo'", "[radar] has kind, pri"]);
    assert!(!far.stderr.contains("did you mean"), "{far:?}");
    info("radar.slop=3").failed(1, &["did you mean 'radar.slope'?"]);
    info("radra.slope=3").failed(1, &["did you mean 'radar.slope'?"]);
    info("recording.slope=3").failed(1, &["did you mean 'radar.slope'?"]);
    info("recording.first=81").failed(1, &["the last pulse is 80"]);
    info("recording.count=82").failed(1, &["'count' is 82", "there are 81"]);
    let vary = |key: &str| {
        run(
            at,
            &format!("tune raw/recording.toml --at 0,4 --vary {key}"),
        )
    };
    for wrong in ["radar.foo=0:1:0.1s", "recording.range_bias=0:1:0.1s"] {
        let ran = vary(wrong);
        ran.failed(1, &["--vary"]);
        assert!(!ran.stderr.contains("--set"), "{ran:?}");
    }
    // A scenario in place of a recording, and the reverse.
    for line in [
        "focus scene.toml --out d",
        "tune scene.toml --at 0,4 --vary radar.pri=1:2:1s",
    ] {
        run(at, line).failed(
            1,
            &["scene.toml:3:", "If the text is a scenario, simulate it"],
        );
    }
    run(at, "simulate raw/recording.toml -o a.cphd")
        .failed(1, &["recording.toml:4:", "subap focus"]);
    assert!(!at.join("a.cphd").exists() && !at.join("d").exists());
}

#[test]
fn pulse_longer_than_its_record_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let echoes = numpy::array("<c8", "(4, 64)", &[0x3c; 4 * 64 * 8]);
    fs::write(at.join("echoes.npy"), echoes).unwrap();
    let text = |pulse: &str| {
        format!(
            "[recording]\nformat = \"npy\"\nfile = \"echoes.npy\"\nphase = \"minus\"\n[radar]\nkind = \"pulsed\"\ncentre = \"10 GHz\"\n\
             sample_rate = \"100 MHz\"\nwindow_start = \"1 us\"\n[radar.pulse]\n{pulse}\n\
             [platform]\nkind = \"rail\"\nfrom = \"-1, 0, 0 m\"\nto = \"1, 0, 0 m\"\n"
        )
    };
    // The program is built on first use.
    run(at, "--version").succeeded();
    let start = Instant::now();
    for (pulse, place) in [
        (
            "kind = \"lfm\"\nbandwidth = \"50 MHz\"\nduration = \"7 s\"",
            "r.toml:13:",
        ),
        (
            "kind = \"code\"\ncode = \"barker-13\"\nchip = \"1 s\"",
            "r.toml:13:",
        ),
    ] {
        fs::write(at.join("r.toml"), text(pulse)).unwrap();
        run(at, "info r.toml").failed(1, &[place, "64 samples", "0.640000 us"]);
    }
    // Seven seconds of pulse are 7e8 samples: half a minute and more.
    assert!(start.elapsed() < Duration::from_secs(10));
    let short = "kind = \"lfm\"\nbandwidth = \"50 MHz\"\nduration = \"0.4 us\"";
    fs::write(at.join("r.toml"), text(short)).unwrap();
    run(at, "info r.toml").succeeded();
}

#[test]
fn file_size_that_is_no_multiple_of_a_pulse_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("a.bin"), vec![1u8; 4 * 4 * 100 * 10]).unwrap();
    let text = "[recording]\nformat = \"dca1000\"\nfile = \"a.bin\"\nsamples = 96\nreceivers = 4\nphase = \"plus\"\n\
                [radar]\nkind = \"fmcw\"\nstart = \"77 GHz\"\nslope = \"40 MHz/us\"\nsample_rate = \"2 MHz\"\n\
                [platform]\nkind = \"rail\"\nfrom = \"-1, 0, 0 m\"\nto = \"1, 0, 0 m\"\n";
    fs::write(at.join("r.toml"), text).unwrap();
    run(at, "info r.toml").failed(
        1,
        &[
            "r.toml:4:",
            "a.bin",
            "4000 samples",
            "10 sweeps",
            "a rest of 160",
            "100",
        ],
    );
    // Without a stated scene, and with the origin on the rail, neither geometry nor a grid is derived from the origin without a warning.
    let ran = run(at, "info r.toml --set recording.samples=100");
    ran.succeeded();
    assert!(
        ran.stderr
            .contains("warning: resolution and geometry apply at x 0 m"),
        "{ran:?}"
    );
    assert!(ran.stderr.contains("is at the antennas"), "{ran:?}");
    run(at, "focus r.toml --set recording.samples=100 --out image").failed(
        1,
        &[
            "no default grid",
            "does not state the position of its scene",
            "--grid",
        ],
    );
}

/// NovAtel's CRC-32: reflected 0xEDB88320 from 0, without a final complement.
fn crc(text: &str) -> u32 {
    text.bytes().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| {
            if c & 1 == 1 {
                (c >> 1) ^ 0xEDB8_8320
            } else {
                c >> 1
            }
        })
    })
}

#[test]
fn track_on_the_earth_needs_a_scene_on_the_earth() {
    let folder = folder();
    let at = folder.path();
    let log: String = (0..40)
        .map(|i| {
            let (seconds, latitude) = (1000.0 + f64::from(i) * 0.05, 51.1 + f64::from(i) * 1e-6);
            let text = format!(
                "INSPVAA,COM1,0,31.0,FINESTEERING,1820,{seconds:.3},00000000,54e2,12002;1820,{seconds:.3},\
                 {latitude:.9},-114.03,1063.0,0.1,0.1,0.0,0.1,0.2,45.0,INS_SOLUTION_GOOD"
            );
            format!("#{text}*{:08x}\n", crc(&text))
        })
        .collect();
    fs::write(at.join("log.asc"), &log).unwrap();
    fs::write(at.join("raw/log.asc"), &log).unwrap();
    let platform = "[platform]\nkind = \"novatel\"\nfile = \"log.asc\"\nrecord = \"inspva\"\n";
    let scenario = SCENE.split("[platform]").next().unwrap().to_owned()
        + platform
        + "[scene]\nreference = \"4, 0, 0 m\"\n";
    fs::write(at.join("log.toml"), &scenario).unwrap();
    let parts = [
        "[scene.origin]",
        "latitude = \"51.10000 deg\"",
        "longitude = \"-114.03000 deg\"",
        "height = \"1063 m\"",
    ];
    run(at, "simulate log.toml -o a.cphd").failed(1, &parts);
    let text = fs::read_to_string(at.join("raw/recording.toml")).unwrap();
    let start = text.find("[platform]").unwrap();
    fs::write(at.join("raw/log.toml"), text[..start].to_owned() + platform).unwrap();
    run(at, "info raw/log.toml").failed(1, &parts);
    // An invalid origin is reported, and a valid one is accepted.
    let origin = |latitude: &str| {
        format!(
            "\n[scene.origin]\nlatitude = \"{latitude}\"\nlongitude = \"-114.03 deg\"\nheight = \"1063 m\"\n"
        )
    };
    fs::write(at.join("log.toml"), scenario.clone() + &origin("31.1 deg")).unwrap();
    run(at, "simulate log.toml -o a.cphd").failed(1, &["km from [scene.origin]", "51.10000 deg"]);
    fs::write(at.join("log.toml"), scenario + &origin("51.1 deg")).unwrap();
    run(at, "simulate log.toml -o a.cphd -q").succeeded();
}

#[test]
fn error_of_echoes_outside_window_names_existing_keys() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let pulsed = "kind = \"pulsed\"\npulses = 16\npri = \"5 ms\"\ncentre = \"10 GHz\"\nsamples = 256\nsample_rate = \"180 MHz\"\n\
                  [radar.pulse]\nkind = \"lfm\"\nbandwidth = \"150 MHz\"\nduration = \"0.5 us\"\n\n";
    let (start, end) = (
        SCENE.find("kind = \"fmcw\"").unwrap(),
        SCENE.find("[platform]").unwrap(),
    );
    let far = SCENE[..start].to_owned()
        + pulsed
        + &SCENE[end..].replace("reference = \"0, 4, 0 m\"", "reference = \"0, 400, 0 m\"");
    fs::write(at.join("far.toml"), far).unwrap();
    let ran = command(at, "simulate far.toml -o a.cphd".split(' '))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(
        said.contains("far.toml") && said.contains("window_start") && said.contains("samples to"),
        "{said}"
    );
    assert!(!said.contains("num_samples"), "{said}");
}

#[test]
fn recording_given_twice_is_named_by_its_files() {
    let folder = folder();
    let at = folder.path();
    fs::copy(at.join("scene.cphd"), at.join("twin.cphd")).unwrap();
    run(at, "info scene.cphd twin.cphd").failed(1, &["scene.cphd", "twin.cphd", "share 81 pulses"]);
}
