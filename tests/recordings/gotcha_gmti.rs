//! The layout of AFRL's Gotcha GMTI challenge: collections simulated by a script with its own formulas, and every invalid one. The original files
//! were not available.
//!
//! Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::path::Path;

use num_complex::{Complex32, Complex64};
use serde_json::Value as Json;
use subaperture::focus::exact::Exact;
use subaperture::io::gotcha_gmti::{GotchaGmti, Settings};
use subaperture::io::open::{Options, open, open_channels};
use subaperture::phase_history::{PhaseHistory, ReadError};
use subaperture::prelude::*;
use subaperture_tests::gotcha_gmti::{Content, PULSES, SAMPLES};
use subaperture_tests::matlab::{self, Value};
use subaperture_tests::subap::run;

use crate::arrays::python;

/// Files of the script, and its truth.
fn written() -> (tempfile::TempDir, Json) {
    let folder = tempfile::tempdir().unwrap();
    python("gotcha_gmti_write.py", folder.path());
    let truth = std::fs::read(folder.path().join("truth.json")).unwrap();
    (folder, serde_json::from_slice(&truth).unwrap())
}

fn numbers(list: &Json) -> Vec<f64> {
    let list = list.as_array().unwrap();
    list.iter().map(|value| value.as_f64().unwrap()).collect()
}

/// Pixel at a place.
fn pixel(history: &dyn PhaseHistory, [x, y, z]: [f64; 3]) -> Complex64 {
    let grid = format!("x={x}:{}:1,y={y}:{}:1,z={z}", x + 0.5, y + 0.5);
    let grid: ImageGrid = grid.parse().unwrap();
    let image = Exact.focus(history, &grid).unwrap().image;
    assert_eq!(image.pixels.len(), 1);
    let value = image.pixels[0];
    Complex64::new(value.re.into(), value.im.into())
}

/// Check the position and the value of the script's only scatterer.
fn check_point(history: &dyn PhaseHistory, truth: &Json) {
    let place: [f64; 3] = numbers(&truth["point_m"]).try_into().unwrap();
    let [re, im] = numbers(&truth["amplitude"])[..] else {
        panic!("{truth}")
    };
    let value = pixel(history, place);
    let off = (value - Complex64::new(re, im)).norm();
    println!("{}: {value:.7}, {off:.1e} off", history.collection().name);
    assert!(off < 1e-6, "{value} and not {re} + {im} j");
    // Resolution of 0.29 m in range along y, and of 31.2 mm * 2081 m / (2 * 6.3 m) = 5.2 m along x. The peak is within an eighth of it
    // where the level a quarter to either side is lower.
    for (axis, cell_m) in [5.2, 0.29].into_iter().enumerate() {
        for side in [-0.25, 0.25] {
            let mut near = place;
            near[axis] += side * cell_m;
            let level = pixel(history, near).norm();
            assert!(level < 0.99 * value.norm(), "{level} at {near:?}");
        }
    }
}

#[test]
fn point_of_the_script_has_its_position_and_value_in_every_channel() {
    let (folder, truth) = written();
    let path = folder.path().join("simulated_chan1_one_PH");
    let offsets = numbers(&truth["offsets_m"]);
    let text: Vec<String> = offsets.iter().map(|m| format!("{m} m")).collect();
    let settings = [("receiver_offset".to_owned(), text.join(","))];
    let options = Options {
        settings: &settings,
        ..Options::default()
    };
    let channels = open_channels::<&str>(&path, None, &options).unwrap();
    let names: Vec<&str> = channels.about().map(|about| about.name.as_str()).collect();
    assert_eq!(names, ["1", "2", "3"]);
    for (_, history) in channels.iter() {
        // Samples rounded to float32, 6e-8 each, and a pixel of float32. The direction of the track is wrong at the ends by (3.1 m / 1700 m)^3 / 4 = 1.5e-9: 2 nm of a
        // displacement of 1.2 m, 4e-7 rad.
        check_point(history, &truth);
        assert_eq!(history.warnings(), [""; 0]);
        assert_eq!(history.defects(), []);
        assert_eq!(history.inputs().unwrap().len(), 3);
    }

    let history = open(&path, &Options::default()).unwrap();
    check_point(&*history, &truth);
    let collection = history.collection();
    let starts_hz = numbers(&truth["start_hz"]);
    assert_eq!(collection.pulses.len(), starts_hz.len());
    assert!(collection.timed && collection.band().is_none());
    let step_hz = truth["step_hz"].as_f64().unwrap();
    let prf_hz = truth["prf_hz"].as_f64().unwrap();
    for (n, (pulse, start_hz)) in collection.pulses.iter().zip(starts_hz).enumerate() {
        // Five roundings of float64 at 9.6 GHz, 1e-6 Hz each.
        assert!((pulse.start_hz - start_hz).abs() < 1e-5, "{pulse:?}");
        assert!((pulse.step_hz - step_hz).abs() < 1e-8);
        assert_eq!(pulse.time_s, n as f64 / prf_hz);
        assert_eq!(pulse.receiver_m, pulse.transmitter_m);
    }

    // The channel of the named file, another one, and two of three.
    let named = |path: &str, channel: Option<&str>| {
        let options = Options {
            channel,
            ..Options::default()
        };
        let opened = open(&folder.path().join(path), &options).unwrap();
        opened.collection().name.clone()
    };
    let [one, two, three] = [1, 2, 3].map(|n| format!("simulated_chan{n}_one_PH"));
    assert_eq!(named(&two, None), two);
    assert_eq!(named(&two, Some("3")), three);
    std::fs::remove_file(folder.path().join(&one)).unwrap();
    let options = Options::default();
    let left = open_channels::<&str>(&folder.path().join(&three), None, &options).unwrap();
    let names: Vec<&str> = left.about().map(|about| about.name.as_str()).collect();
    assert_eq!(names, ["2", "3"]);
    assert!(left.channel(0).warnings()[0].contains("receiver_offset"));
    assert!(open_channels(&folder.path().join(&three), Some(&["1"]), &options).is_err());

    // Ranges from another point than the origin are kept.
    let moved = folder.path().join("simulated_chan1_moved_PH");
    check_point(&*open(&moved, &options).unwrap(), &truth);
}

#[test]
fn gmti_finds_the_mover_of_the_script() {
    let (folder, truth) = written();
    let at = folder.path();
    let line = "gmti simulated_chan1_scene_PH -o t.geojson --grid x=-20:20:0.3,y=-12:12:0.12";
    run(at, line).failed(
        1,
        &["receiver_offset", "state the positions of the receivers"],
    );
    let offsets: Vec<String> = (numbers(&truth["offsets_m"]).iter())
        .map(|m| format!("{m}m"))
        .collect();
    let line = format!("{line} --set receiver_offset={}", offsets.join(","));
    let ran = run(at, &line);
    assert!(ran.succeeded().contains("1 moving target"), "{ran:?}");
    let record: Json =
        serde_json::from_slice(&std::fs::read(at.join("t.geojson")).unwrap()).unwrap();
    let target = &record["features"][0]["properties"];
    let place = numbers(&target["position_m"]);
    let mover = &truth["mover"];
    let expected = numbers(&mover["position_m"]);
    let got_m_s = target["radial_velocity_m_s"].as_f64().unwrap();
    let sigma_m_s = target["velocity_deviation_m_s"].as_f64().unwrap();
    let off_m_s = got_m_s - mover["radial_velocity_m_s"].as_f64().unwrap();
    println!("{place:?} and not {expected:?}, {off_m_s:.4} +- {sigma_m_s:.4} m/s off");
    // Resolution cells: 31.2 mm * 2081 m / (2 * 35.9 m) = 0.90 m along the track, 0.29 m in range.
    assert!((place[0] - expected[0]).abs() < 0.90, "{place:?}");
    assert!((place[1] - expected[1]).abs() < 0.29, "{place:?}");
    // Four standard deviations, which are below 5 % of the velocity.
    assert!(
        off_m_s.abs() < 4.0 * sigma_m_s && sigma_m_s < 0.02,
        "{off_m_s} +- {sigma_m_s}"
    );

    // Errors of stated offsets are estimated from the clutter. 5 mm are a phase of 0.01 rad at the ends of the image, 20 m from its middle at 2081 m: the spread
    // of the phases of blocks about the model.
    let rough = line
        .replace("-0.6m,-1.2m", "-0.55m,-1.3m")
        .replace("t.geo", "r.geo");
    run(at, &rough).succeeded();
    let record = std::fs::read(at.join("r.geojson")).unwrap();
    let record: Json = serde_json::from_slice(&record).unwrap();
    for (channel, expected_m) in [(1, -0.05), (2, 0.1)] {
        let registration = &record["channels"][channel]["registration"];
        let along_m = registration["along_m"].as_f64().unwrap();
        println!("channel {channel}: {along_m:.4} and not {expected_m} m");
        assert!((along_m - expected_m).abs() < 5e-3, "{registration}");
    }

    // Receivers in the opposite order are recognised.
    let other = line
        .replace("-0.6m,-1.2m", "0.6m,1.2m")
        .replace("t.geo", "u.geo");
    assert_ne!(line, other);
    run(at, &other).failed(1, &["probably exchanged"]);
    // Integration over sub-CPIs requires one frequency axis.
    run(at, &format!("{line} --sub-cpis 9 --force")).failed(1, &["without sub-CPIs"]);
    run(at, &line.replace("receiver_offset", "radar.pri"))
        .failed(1, &["radar.pri", "expected receiver_offset or prf"]);
}

fn message(content: &Content) -> String {
    let folder = tempfile::tempdir().unwrap();
    opened(&content.write(folder.path()))
        .err()
        .unwrap()
        .to_string()
}

fn opened(path: &Path) -> Result<GotchaGmti, ReadError> {
    GotchaGmti::open(path, None, &Settings::default(), u64::MAX)
}

#[test]
fn samples_are_big_endian_pulses() {
    let folder = tempfile::tempdir().unwrap();
    let path = Content::default().write(folder.path());
    let history = opened(&path).unwrap();
    let collection = history.collection();
    assert_eq!(
        (collection.pulses.len(), collection.num_samples),
        (PULSES, SAMPLES)
    );
    let mut samples = vec![Complex32::ZERO; 2 * SAMPLES];
    history.read(1..3, &mut samples).unwrap();
    for (i, z) in samples.iter().enumerate() {
        let (n, k) = (1 + i / SAMPLES, i % SAMPLES);
        let expected = Complex32::new(1.0 + k as f32 + 1000.0 * n as f32, -1.0);
        assert_eq!(*z, expected);
    }
    // df = 2.96e12 / 2.5e7 = 118400 Hz; pulse 2: 9.6e9 + 2 * 118400 + 1000 + (-0.25 - 2704 + 1) df, R0 = |a| - 1 m + 4 c / (2 * 5400 df).
    let pulse = collection.pulses[2];
    assert_eq!(
        pulse.start_hz,
        9.6e9 + 236_800.0 + 1000.0 - 2703.25 * 118_400.0
    );
    assert!((pulse.step_hz - 118_400.0 * 5400.0 / 384.0).abs() < 1e-8);
    let range_m = 25_000_036f64.sqrt() - 1.0 + 4.0 * 299_792_458.0 / (10_800.0 * 118_400.0);
    assert!((pulse.reference_path_m - 2.0 * range_m).abs() < 1e-9);
    assert_eq!(pulse.time_s, 2.0 / 2000.0);

    // Without a PRF there are no times, unless a setting states it.
    let mut content = Content::default();
    content.auxiliary.retain(|(name, _)| *name != "PRF");
    let path = content.write(folder.path());
    assert!(!opened(&path).unwrap().collection().timed);
    let settings = [("prf".to_owned(), "1 kHz".to_owned())];
    let options = Options {
        settings: &settings,
        ..Options::default()
    };
    let stated = open(&path, &options).unwrap();
    assert_eq!(stated.collection().pulses[2].time_s, 0.002);
}

#[test]
fn missing_and_invalid_fields_are_named() {
    let without = |name: &str| {
        let mut content = Content::default();
        content.auxiliary.retain(|(field, _)| *field != name);
        content.positions.retain(|(field, _)| *field != name);
        message(&content)
    };
    for name in [
        "aux_SPIE.readPrm",
        "aux_SPIE.circshiftFloorPHradius",
        "aux_SPIE.PHradius_sampleError",
        "paux.APCpos",
        "paux.APCMag",
        "paux.Gamma",
        "paux.PHradius",
    ] {
        let text = without(name.split('.').next_back().unwrap());
        assert!(text.contains(&format!("{name} is missing")), "{text}");
        assert!(text.contains("fields found: "), "{text}");
    }
    let row = |values: &[f64]| Value::Double(1, values.len() as i32, values.to_vec());
    let nan = f64::NAN;
    for (name, value, part) in [
        (
            "Gamma",
            row(&[0.0]),
            "paux.Gamma: expected a positive number of hertz per second, found 0",
        ),
        (
            "Gamma",
            Value::Empty,
            "paux.Gamma: expected a positive number of hertz per second, found 0 x 0",
        ),
        ("Gamma", row(&[nan]), "found NaN"),
        (
            "PHradius",
            row(&[9.6e9; 2]),
            "paux.PHradius: expected 3 values, since",
        ),
        (
            "PHradius",
            row(&[81_000.0; 3]),
            "paux.PHradius of pulse 0: expected hertz, found 81000",
        ),
        (
            "PHradius",
            row(&[9.6e9, nan, 9.6e9]),
            "paux.PHradius: expected finite values, found NaN at index 1",
        ),
        (
            "APCMag",
            row(&[5e3, 5e3, -1.0]),
            "paux.APCMag of pulse 2: expected a positive range",
        ),
        (
            "APCpos",
            Value::Double(3, 2, vec![1e3; 6]),
            "paux.APCpos: expected 3 x 3 values",
        ),
        (
            "APCpos",
            Value::Double(3, 3, vec![1e12; 9]),
            "pulse 0: its transmitter",
        ),
        (
            "APCpos",
            Value::Text("far"),
            "paux.APCpos: expected real numbers, found 1 x 3 text",
        ),
        ("PHradius_sampleError", row(&[0.0; 2]), "expected 3 values"),
        (
            "circshiftFloorPHradius",
            row(&[f64::INFINITY; 3]),
            "found inf at index 0",
        ),
        (
            "PRF",
            row(&[-5.0]),
            "aux_SPIE.PRF: expected a positive number of hertz, found -5",
        ),
        (
            "PRF",
            row(&[1e9]),
            "aux_SPIE.PRF: expected a pulse repetition frequency from",
        ),
        (
            "readPrm",
            row(&[1.0]),
            "'aux_SPIE.readPrm': expected a 1 x 1 structure with Fsamp",
        ),
        (
            "readPrm",
            Value::Structure(
                1,
                1,
                vec![("Fsamp", row(&[0.0])), ("deltaRbin", row(&[0.0; 3]))],
            ),
            "aux_SPIE.readPrm.Fsamp: expected a positive number",
        ),
        (
            "readPrm",
            Value::Structure(1, 1, vec![("Fsamp", row(&[2.5e7]))]),
            "aux_SPIE.readPrm.deltaRbin is missing",
        ),
    ] {
        let mut content = Content::default();
        *content.field(name) = value;
        let text = message(&content);
        assert!(text.contains(part), "{name}: {text}");
    }
}

#[test]
fn missing_damaged_and_mixed_files_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let whole = Content::default();
    let refused = |path: &Path, parts: &[&str]| {
        let text = opened(path).err().expect("an error").to_string();
        for part in parts {
            assert!(text.contains(part), "{text}");
        }
    };
    let path = whole.write(at);
    let put = |name: &str, bytes: &[u8]| std::fs::write(at.join(name), bytes).unwrap();

    put("a_chan1_b_PH", &whole.samples[..5000]);
    refused(&path, &["a multiple of 3072 bytes, found 5000 bytes"]);
    put("a_chan1_b_PH", b"");
    refused(&path, &["found 0 bytes"]);
    put("a_chan1_b_PH", &whole.samples[3072..]);
    refused(
        &path,
        &[
            "paux.APCpos: expected 3 x 2 values",
            "a_chan1_b_PH has 2 pulses",
        ],
    );
    let mut swapped = whole.samples.clone();
    swapped.chunks_exact_mut(4).for_each(<[u8]>::reverse);
    put("a_chan1_b_PH", &swapped);
    refused(&path, &["expected big-endian float32, found little-endian"]);
    put("a_chan1_b_PH", &[0x7f; 3 * 3072]);
    refused(&path, &["implausible magnitude"]);
    let mut infinite = whole.samples.clone();
    infinite[3072 + 8..3072 + 12].copy_from_slice(&f32::INFINITY.to_be_bytes());
    put("a_chan1_b_PH", &infinite);
    let mut samples = vec![Complex32::ZERO; 3 * SAMPLES];
    match opened(&path).unwrap().read(0..3, &mut samples) {
        Err(ReadError::NotFinite { pulse, sample, .. }) => assert_eq!((pulse, sample), (1, 1)),
        other => panic!("{other:?}"),
    }
    put("a_chan1_b_PH", &whole.samples);

    // Channels with other numbers of pulses.
    put("a_chan2_b_PH", &whole.samples[..3072]);
    let options = Options::default();
    let text = open_channels::<&str>(&path, None, &options)
        .err()
        .unwrap()
        .to_string();
    assert!(
        text.contains("expected 3 pulses as in") && text.contains("found 1"),
        "{text}"
    );
    std::fs::remove_file(at.join("a_chan2_b_PH_auxSaveData.mat")).unwrap();
    put("a_chan2_b_PH", &whole.samples);
    let text = open_channels::<&str>(&path, None, &options)
        .err()
        .unwrap()
        .to_string();
    assert!(text.contains("a_chan2_b_PH_auxSaveData.mat"), "{text}");

    put("a_b_PAUX.mat", &matlab::file(&[]));
    refused(
        &path,
        &[
            "expected a structure 'paux' with APCpos",
            "variables found: none",
        ],
    );
    put(
        "a_b_PAUX.mat",
        &matlab::file(&[matlab::matrix("paux", &Value::Double(1, 1, vec![1.0]))]),
    );
    refused(
        &path,
        &["'paux': expected a 1 x 1 structure", "found 1 x 1 double"],
    );
    std::fs::remove_file(at.join("a_b_PAUX.mat")).unwrap();
    refused(
        &path,
        &[
            "readPAUXData('a_b_PAUX')",
            "save('a_b_PAUX.mat', 'paux', '-v6')",
        ],
    );
    refused(&at.join("a_b_PAUX"), &["PREFIX_chanN_SET_PH"]);
    let text = open(at, &options).err().unwrap().to_string();
    assert!(text.contains("found a directory"), "{text}");

    // Positions that do not move have no direction along a track.
    let mut still = Content::default();
    *still.field("APCpos") = Value::Double(3, 3, [0.0, -4000.0, 3000.0].repeat(3));
    let path = still.write(at);
    let settings = Settings {
        receiver_offsets_m: Some([1.0, 0.0, 0.0]),
        prf_hz: None,
    };
    let error = GotchaGmti::open(&path, None, &settings, u64::MAX)
        .err()
        .unwrap();
    assert!(
        error.to_string().contains("does not move at pulse 0"),
        "{error}"
    );
    assert!(opened(&path).is_ok());
}

#[test]
fn swath_away_from_the_origin_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let mut content = Content::default();
    // 110 bins of 0.234 m, of a swath of 90 m.
    let reading = vec![
        ("Fsamp", Value::Double(1, 1, vec![2.5e7])),
        ("deltaRbin", Value::Double(1, 3, vec![110.0; 3])),
    ];
    *content.field("readPrm") = Value::Structure(1, 1, reading);
    let history = opened(&content.write(folder.path())).unwrap();
    let [warning] = &history.warnings()[..] else {
        panic!("{:?}", history.warnings());
    };
    assert!(
        warning.contains("24.8 to 24.8 m beyond the origin, of a swath of 90.0 m"),
        "{warning}"
    );
}

#[test]
fn gmti_refuses_frequencies_that_differ_by_more_than_a_tenth_of_the_step() {
    let folder = tempfile::tempdir().unwrap();
    // The step is 1.665 MHz.
    for (more_hz, refused) in [(160e3, false), (170e3, true)] {
        let mut content = Content::default();
        let Value::Double(.., radii_hz) = content.field("PHradius") else {
            panic!("PHradius is a row");
        };
        radii_hz[2] += more_hz;
        content.write(folder.path());
        let line = "gmti a_chan1_b_PH -o t.geojson --set receiver_offset=0m,-0.5m,0m --grid x=-1:1:0.5,y=-1:1:0.5";
        let ran = run(folder.path(), line);
        let named = ran.stderr.contains("at most a tenth of their step");
        assert_eq!(named, refused, "{more_hz} Hz: {ran:?}");
    }
}
