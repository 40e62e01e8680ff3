//! Zero pulses, gaps, bias, imbalance and clipping: reports with numbers, and images of the corrected samples.

use std::fs;

use num_complex::{Complex32, Complex64};
use serde_json::{Value, json};
use subaperture::io::recording::RecordingFile;
use subaperture::phase_history::PhaseHistory;
use subaperture_tests::numpy;
use subaperture_tests::subap::run;

use super::*;

/// Defects that `subap info --json` reports for `rail.toml`.
fn reported(folder: &Path) -> Vec<Value> {
    let info = run(folder, "info rail.toml --json");
    let json: Value = serde_json::from_str(info.succeeded()).unwrap();
    json["defects"].as_array().unwrap().clone()
}

#[track_caller]
fn assert_near(value: &Value, expected: f64, most: f64) {
    let number = value.as_f64().unwrap();
    assert!((number - expected).abs() < most, "{number} {expected}");
}

/// A gap of pulses 130 to 169 in the middle of the aperture.
fn is_lost(n: usize) -> bool {
    (130..170).contains(&n)
}

/// Level of the first target. Its side lobes and those of the others, below -40 dB under the default windows, are the
/// tolerance: 1 % with a gap.
fn assert_reads_one(folder: &Path, image: &str) {
    let value = at_target(folder, image, TARGETS[0].0);
    assert!((value.norm() - 1.0).abs() < 0.02, "{image}: {value}");
}

#[test]
fn recording_without_defects_has_no_warning() {
    let folder = recorded(&samples(|_, z| z), "");
    let at = folder.path();
    let info = run(at, "info rail.toml");
    info.succeeded();
    assert_eq!(info.stderr, "");
    assert_eq!(reported(at), [] as [Value; 0]);
    run(at, &format!("focus rail.toml --out image -a bp -q {GRID}")).succeeded();
    assert_eq!(warnings(at, "image"), "[]");
    assert_reads_one(at, "image");
}

#[test]
fn zero_pulses_are_counted_and_left_out() {
    let lost = |n, z| if is_lost(n) { Complex64::ZERO } else { z };
    let folder = recorded(&samples(lost), "");
    let at = folder.path();
    let part = "rail: 40 of 400 pulses contain only zeros and are left out, the first is pulse 130";
    let info = run(at, "info rail.toml");
    assert!(info.succeeded().contains("360 pulses of"), "{info:?}");
    info.reports(part);
    let json: Value = serde_json::from_str(run(at, "info rail.toml --json").succeeded()).unwrap();
    assert!(json["warnings"].to_string().contains(part), "{json}");
    let zeros = json!({
        "recording": "rail", "channel": null, "receiver": null, "examined_pulses": 400, "pulses": 400,
        "kind": "zero_pulses", "count": 40, "first_pulse": 130, "channels": 1, "left_out": true
    });
    assert_eq!(json["defects"], json!([zeros]));
    for former in ["bp", "ffbp", "rdbp", "rda", "omega-k"] {
        let line =
            format!("focus rail.toml --out {former} -a {former} --error-db -35 --check 99 {GRID}");
        run(at, &line).succeeded();
        assert!(warnings(at, former).contains(part), "{former}");
        assert_reads_one(at, former);
    }
    // Samples of zeros only are no recording.
    run(
        at,
        "focus rail.toml --out none --set recording.first=130 --set recording.count=40",
    )
    .failed(1, &["rail.toml:", "found 40 pulses of zeros", "^"]);
}

#[test]
fn gap_in_times_is_counted_and_image_is_normalised_by_recorded_pulses() {
    let kept: Vec<Complex64> = samples(|_, z| z)
        .chunks(SAMPLES)
        .enumerate()
        .filter(|(n, _)| !is_lost(*n))
        .flat_map(|(_, row)| row.to_vec())
        .collect();
    let folder = recorded(&kept, "");
    let at = folder.path();
    write_times(at, (0..PULSES).filter(|n| !is_lost(*n)));
    let part = "rail: 40 pulses are missing in 1 gap of the pulse times";
    let info = run(at, "info rail.toml");
    info.reports(part);
    info.reports("after pulse 129");
    let [gaps] = &reported(at)[..] else {
        panic!("{:?}", reported(at));
    };
    for (key, value) in [
        ("kind", json!("gaps")),
        ("missing_pulses", json!(40)),
        ("gaps", json!(1)),
        ("after_pulse", json!(129)),
        ("pulses", json!(360)),
    ] {
        assert_eq!(gaps[key], value, "{key}: {gaps}");
    }
    assert_near(&gaps["share"], 0.1, 1e-12);
    assert_near(&gaps["after_s"], 129.0 * PRI_S, 1e-12);
    assert_near(&gaps["first_gap_s"], 41.0 * PRI_S, 1e-12);
    assert_near(&gaps["interval_s"], PRI_S, 1e-12);
    for former in ["bp", "rda", "omega-k"] {
        let line =
            format!("focus rail.toml --out {former} -a {former} --error-db -35 --check 99 {GRID}");
        run(at, &line).succeeded();
        assert!(warnings(at, former).contains(part), "{former}");
        assert_reads_one(at, former);
    }
    // A block of pulses before the gap has none.
    let block = run(at, "info rail.toml --set recording.count=130");
    block.succeeded();
    assert_eq!(block.stderr, "");
}

/// Phase history of a description, with settings.
fn history(folder: &Path, name: &str, settings: &[(&str, &str)]) -> Vec<Complex32> {
    let mut file = RecordingFile::read(&folder.join(name)).unwrap();
    for (key, value) in settings {
        file.set(key, value).unwrap();
    }
    let history = file.history(u64::MAX).unwrap();
    let collection = history.collection();
    let count = collection.pulses.len();
    let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
    history.read(0..count, &mut samples).unwrap();
    samples
}

/// Relative RMS difference of samples.
fn difference(a: &[Complex32], b: &[Complex32]) -> f64 {
    let power = |z: Complex32| f64::from(z.norm_sqr());
    let error: f64 = a.iter().zip(b).map(|(a, b)| power(a - b)).sum();
    (error / b.iter().map(|z| power(*z)).sum::<f64>()).sqrt()
}

/// Q has a gain of 1.12 (0.98 dB) and a phase error of 5 degrees relative to I: images of 0.072 (-22.9 dB), by
/// `|1 - g exp(j e)| / |1 + g exp(-j e)|`.
#[test]
fn bias_and_imbalance_are_measured_and_corrected() {
    let (gain, error_rad) = (1.12, 5f64.to_radians());
    let recorded_by = |_, z: Complex64| {
        let q = gain * (z.im * error_rad.cos() + z.re * error_rad.sin());
        Complex64::new(z.re + 0.3, q - 0.2)
    };
    let folder = recorded(&samples(recorded_by), "");
    let at = folder.path();
    write_array(at, "clean.npy", &samples(|_, z| z), SAMPLES);
    let text = fs::read_to_string(at.join("rail.toml")).unwrap();
    fs::write(
        at.join("clean.toml"),
        text.replace("echoes.npy", "clean.npy"),
    )
    .unwrap();
    let info = run(at, "info rail.toml");
    info.succeeded();
    for part in [
        "rail: I/Q bias of 0.29",
        "in I and -0.20",
        "background = \"mean\" or iq = \"correct\"",
        "rail: I/Q imbalance, Q has a gain of +0.9",
        "phase error of +5.",
        "images of -22.",
        "correct it by [recording] iq = \"correct\"",
    ] {
        info.reports(part);
    }
    let [bias, imbalance] = &reported(at)[..] else {
        panic!("{:?}", reported(at));
    };
    assert_eq!(
        (&bias["kind"], &bias["corrected"]),
        (&json!("bias"), &json!(false))
    );
    // The bias includes the mean of the echoes. Samples are float32 below 4: rounded to 1.2e-7.
    let values = samples(recorded_by);
    let mean = values.iter().sum::<Complex64>() / values.len() as f64;
    let deviation = |part: fn(Complex64) -> f64| {
        let squares = values.iter().map(|z| part(z - mean).powi(2));
        (squares.sum::<f64>() / values.len() as f64).sqrt()
    };
    for (key, expected) in [
        ("re", mean.re),
        ("im", mean.im),
        ("re_deviation", deviation(|z| z.re)),
        ("im_deviation", deviation(|z| z.im)),
    ] {
        assert_near(&bias[key], expected, 1e-6);
    }
    // E[z^2] of the echoes, below 1 % of E[z z*], is an error of 0.01 of the gain and of the sine of the phase error, and of half that of
    // the image of 0.072.
    assert_eq!(imbalance["kind"], "imbalance");
    assert_near(&imbalance["gain_db"], 20.0 * gain.log10(), 0.087);
    assert_near(&imbalance["phase_deg"], 5.0, 0.58);
    assert_near(&imbalance["image_db"], -22.9, 0.6);
    let clean = history(at, "clean.toml", &[]);
    let kept = difference(&history(at, "rail.toml", &[]), &clean);
    let set = [("recording.iq", "correct")];
    let corrected = difference(&history(at, "rail.toml", &set), &clean);
    assert!(kept > 0.1, "{kept}");
    // The estimate has the error of the echoes' own E[z^2], below 1 %.
    assert!(corrected < 0.01, "{corrected} {kept}");
    let line = format!("focus rail.toml --out image --set recording.iq=correct -a bp -q {GRID}");
    run(at, &line).succeeded();
    assert!(warnings(at, "image").contains("rail: corrected I/Q bias of 0.29"));
    assert_reads_one(at, "image");
    // No significant rest.
    run(at, "info clean.toml --set recording.iq=correct").reports(
        "rail: no significant bias and imbalance of I and Q: iq = \"correct\" has no effect",
    );
}

/// Background subtraction removes a constant exactly, together with the mean of each sample's echoes.
#[test]
fn background_subtraction_removes_bias() {
    let biased = |_, z: Complex64| z + Complex64::new(0.4, 0.1);
    let folder = recorded(&samples(biased), "background = \"mean\"");
    let at = folder.path();
    write_array(at, "clean.npy", &samples(|_, z| z), SAMPLES);
    let text = fs::read_to_string(at.join("rail.toml")).unwrap();
    fs::write(
        at.join("clean.toml"),
        text.replace("echoes.npy", "clean.npy"),
    )
    .unwrap();
    let [clean, rail] = ["clean.toml", "rail.toml"].map(|name| history(at, name, &[]));
    assert!(difference(&rail, &clean) < 1e-5);
}

#[test]
fn clipped_samples_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Amplitudes of up to 2.2 are limited at 32767 / 20000 = 1.64.
    let parts = samples(|_, z| 20_000.0 * z);
    let parts: Vec<f64> = parts.iter().flat_map(|z| [z.re, z.im]).collect();
    let clipped = parts.iter().filter(|v| v.abs() > 32767.5).count();
    let share = 100.0 * clipped as f64 / parts.len() as f64;
    assert!(share > 0.1, "{share}");
    let bytes: Vec<u8> = parts
        .iter()
        .flat_map(|v| (v.round() as i16).to_le_bytes())
        .collect();
    fs::write(at.join("echoes.bin"), bytes).unwrap();
    let text =
        description("format = \"dca1000\"\norder = \"iqiq\"\nfile = \"echoes.bin\"\nsamples = 128");
    fs::write(
        at.join("rail.toml"),
        text.replace("kind = \"fmcw\"", "kind = \"fmcw\"\npri = \"2.506 ms\""),
    )
    .unwrap();
    let info = run(at, "info rail.toml");
    info.succeeded();
    info.reports("% of the values are clipped, at -32768 or 32767");
    let percent = info
        .stderr
        .split("rail: ")
        .find(|part| part.contains("clipped"))
        .unwrap();
    let percent: f64 = percent.split_whitespace().next().unwrap().parse().unwrap();
    // Two significant digits.
    assert!((percent / share - 1.0).abs() < 0.06, "{percent} {share}");
    let [defect] = &reported(at)[..] else {
        panic!("{:?}", reported(at));
    };
    assert_eq!(defect["kind"], "clipped");
    // Values at the limits of the integers after rounding.
    let is_limit = |v: &&f64| matches!(v.round() as i16, i16::MIN | i16::MAX);
    let count = parts.iter().filter(is_limit).count();
    assert_near(&defect["share"], count as f64 / parts.len() as f64, 1e-12);
    assert_eq!(
        (&defect["low"], &defect["high"]),
        (&json!(-32768.0), &json!(32767.0))
    );
}

/// Recordings of every waveform, with noise and without, of few points: they have no defects.
#[test]
fn simulated_recordings_have_no_defects() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let pulse = "samples = 300\nsample_rate = \"150 MHz\"\n[radar.pulse]\n";
    for (name, radar) in [
        (
            "fmcw",
            "kind = \"fmcw\"\nsamples = 128\nsample_rate = \"1 MHz\"\n".to_owned(),
        ),
        (
            "stepped",
            "kind = \"stepped\"\nsamples = 64\nstep_time = \"1 us\"\n".to_owned(),
        ),
        (
            "lfm",
            format!(
                "kind = \"pulsed\"\n{pulse}kind = \"lfm\"\nbandwidth = \"100 MHz\"\nduration = \"1 us\"\n"
            ),
        ),
        (
            "code",
            format!(
                "kind = \"pulsed\"\n{pulse}kind = \"code\"\ncode = \"barker-13\"\nchip = \"10 ns\"\n"
            ),
        ),
    ] {
        for noise in [false, true] {
            let bandwidth = if name == "fmcw" || name == "stepped" {
                "bandwidth = \"1 GHz\"\n"
            } else {
                ""
            };
            let noise_key = if noise {
                "[radar.noise]\npower = \"-10 dB\"\n"
            } else {
                ""
            };
            let text = format!(
                "name = \"{name}\"\n[radar]\npulses = 161\npri = \"10 ms\"\ncentre = \"24 GHz\"\n{bandwidth}{radar}\n{noise_key}[platform]\nkind = \"rail\"\n\
                 from = \"-0.6, 0, 0 m\"\nto = \"0.6, 0, 0 m\"\nspeed = \"0.75 m/s\"\n[scene]\nreference = \"0, 4, 0 m\"\n[[scene.point]]\n\
                 position = \"0.4, 3.6, 0 m\"\n[[scene.point]]\nposition = \"-0.5, 4.2, 0 m\"\n"
            );
            fs::write(at.join("scene.toml"), text).unwrap();
            let raw = format!("{name}-{noise}");
            let line = format!("simulate scene.toml --echoes {raw} -o {raw}.cphd -q");
            run(at, &line).succeeded();
            let info = run(at, &format!("info {raw}/recording.toml"));
            info.succeeded();
            for sign in ["I/Q", "bias", "clipped", "zeros", "missing"] {
                assert!(!info.stderr.contains(sign), "{raw}: {info:?}");
            }
        }
    }
}

/// Zeros of one channel leave the pulse out of all channels side by side, and only that channel's in the sum.
#[test]
fn zero_pulse_of_one_receiver_is_left_out_of_channels() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut values = Vec::new();
    for n in 0..PULSES {
        for receiver in 0..2 {
            let is_zero = receiver == 1 && n == 7;
            values.extend((0..SAMPLES).map(|k| if is_zero { Complex64::ZERO } else { beat(n, k) }));
        }
    }
    let file = numpy::array(
        "<c8",
        &format!("({PULSES}, 2, {SAMPLES})"),
        &complex64(&values),
    );
    fs::write(at.join("echoes.npy"), file).unwrap();
    let text = description(&format!("{NPY}\nreceivers = 2"));
    let text = text.replace("kind = \"fmcw\"", "kind = \"fmcw\"\npri = \"2.506 ms\"");
    let antennas = "[[radar.receiver]]\nname = \"a\"\n[[radar.receiver]]\nname = \"b\"\noffset = \"0, 0.001, 0 m\"\n";
    fs::write(at.join("rail.toml"), text + antennas).unwrap();
    let sum = run(at, "info rail.toml");
    assert!(sum.succeeded().contains("799 pulses"), "{sum:?}");
    sum.reports("rail: 1 of 800 pulses of all channels contain only zeros");
    let one = run(at, "info rail.toml --channel 1");
    assert!(one.succeeded().contains("399 pulses"), "{one:?}");
}
