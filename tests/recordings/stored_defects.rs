//! Defects of the samples in CRSD and L0B files of noise with known bias, imbalance, clipped values and pulses of zeros; missing pulses and
//! pulses of zeros of CPHD files, arrays and GOTCHA files.
//!
//! Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::f64::consts::TAU;
use std::path::Path;

use num_complex::Complex64;
use subaperture::io::cphd::{Channel, WriteOptions, write};
use subaperture::io::open::{Options, open};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Defect, DefectKind, InMemory};
use subaperture_tests::matlab::{Value, gotcha, gotcha_fields};
use subaperture_tests::numpy::{array, stored};

use crate::arrays::python_with;
use crate::cphd::scene::Scene;

/// Standard errors that an estimate may be off.
const ERRORS: f64 = 5.0;

fn defects(path: &Path) -> (Vec<Defect>, Vec<String>) {
    let history = open(path, &Options::default()).unwrap();
    (history.defects(), history.warnings())
}

/// Recording with a gain of Q of 1.12 and a phase error of 5 degrees.
struct Unbalanced {
    /// Standard deviation of the noise in I, and bias, in the file's units.
    deviation: f64,
    bias: Complex64,
    /// Number of samples that are not zero.
    samples: f64,
    channel: &'static str,
    pulses: usize,
    /// First pulse of zeros in the file.
    first_zero: usize,
}

impl Unbalanced {
    /// Relative standard errors of `n` samples: of the mean of I `1 / sqrt(n)`, of a standard deviation `1 / sqrt(2 n)`, and of the ratio of two
    /// and of the correlation coefficient of I and Q, the sine of the phase error, `1 / sqrt(n)`.
    fn check(&self, defects: &[Defect]) {
        let (gain, error_rad) = (1.12, 5f64.to_radians());
        let standard_error = 1.0 / self.samples.sqrt();
        let most = ERRORS * standard_error;
        for defect in defects {
            let examined = &defect.examined;
            assert_eq!(
                (examined.examined_pulses, examined.pulses),
                (self.pulses, self.pulses)
            );
            assert_eq!(examined.channel.as_deref(), Some(self.channel));
        }
        let [zeros, bias, imbalance] = defects else {
            panic!("{defects:?}");
        };
        let expected = DefectKind::ZeroPulses {
            count: 3,
            first_pulse: self.first_zero,
            channels: 1,
            left_out: false,
        };
        assert_eq!(zeros.kind, expected);
        let DefectKind::Bias {
            re,
            im: Some(im),
            re_deviation,
            im_deviation: Some(im_deviation),
            corrected: false,
        } = bias.kind
        else {
            panic!("{bias:?}");
        };
        let of_q = gain * self.deviation;
        assert!((re - self.bias.re).abs() < most * self.deviation, "{re}");
        assert!((im - self.bias.im).abs() < most * of_q, "{im}");
        assert!((re_deviation / self.deviation - 1.0).abs() < most / 2f64.sqrt());
        assert!((im_deviation / of_q - 1.0).abs() < most / 2f64.sqrt());
        let DefectKind::Imbalance {
            gain_db,
            phase_deg,
            image_db,
            corrected: false,
        } = imbalance.kind
        else {
            panic!("{imbalance:?}");
        };
        // 20 log10(1 + x) = 8.7 x.
        let most_db = 20.0 / 10f64.ln() * most;
        assert!((gain_db - 20.0 * gain.log10()).abs() < most_db, "{gain_db}");
        assert!((phase_deg - 5.0).abs() < most * 360.0 / TAU, "{phase_deg}");
        // Receiver a s + b conj(s) with a = (1 + g exp(-j e)) / 2 and b = (1 - g exp(j e)) / 2. Both parts of b / a = rho / 2 have half the
        // errors of gain and phase.
        let turned = Complex64::from_polar(gain, error_rad);
        let image = ((1.0 - turned) / (1.0 + turned.conj())).norm();
        let most_image_db = most_db / image;
        assert!(
            (image_db - 20.0 * image.log10()).abs() < most_image_db,
            "{image_db}"
        );
    }
}

/// Clipped values as counted by the script, out of `values`; the limits are exact.
fn assert_clipped(folder: &Path, file: &str, values: usize, limits: [f64; 2]) {
    let path = folder.join(file);
    let (defects, warnings) = defects(&path);
    let count = std::fs::read_to_string(path.with_extension("count")).unwrap();
    let count: f64 = count.trim().parse().unwrap();
    let expected = count / values as f64;
    assert!((0.005..0.02).contains(&expected), "{expected}");
    let [defect] = &defects[..] else {
        panic!("{defects:?}");
    };
    let DefectKind::Clipped { share, low, high } = defect.kind else {
        panic!("{defect:?}");
    };
    assert!((share - expected).abs() < 1e-12, "{share} {expected}");
    assert_eq!([low, high], limits);
    let text = warnings.last().unwrap();
    assert!(
        text.contains("% of the values are clipped") && text.contains("Record with less gain"),
        "{text}"
    );
}

fn assert_texts(warnings: &[String], format: &str, zeros: &str) {
    let cure = format!(
        "no setting corrects it in a {format} file. Write the samples as arrays with a description"
    );
    for parts in [
        [zeros, "the normalisation of the image counts them"],
        ["I/Q bias of ", &cure],
        ["I/Q imbalance, Q has a gain of +", &cure],
    ] {
        let has_all = |text: &&String| parts.iter().all(|part| text.contains(part));
        let texts = warnings.iter().filter(has_all).count();
        assert_eq!(texts, 1, "{parts:?}: {warnings:?}");
    }
}

#[test]
fn defects_of_crsd_samples_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    python_with("crsd_write.py", at, &["defects"]);
    let clean = defects(&at.join("noise.crsd"));
    assert_eq!(clean.0, []);
    // The vector of noise is left out.
    assert_eq!(clean.1.len(), 1, "{:?}", clean.1);
    // 48 pulses of 3072 samples, in steps of 1 / 3000. The vector of noise is the sixth, so that pulse 10 is vector 11.
    let (found, warnings) = defects(&at.join("unbalanced.crsd"));
    let expected = Unbalanced {
        deviation: 3000.0,
        bias: Complex64::new(900.0, -600.0),
        samples: 45.0 * 3072.0,
        channel: "R",
        pulses: 48,
        first_zero: 11,
    };
    expected.check(&found);
    let zeros = "3 of 48 pulses contain only zeros, the first is pulse 11:";
    assert_texts(&warnings, "CRSD", zeros);
    let values = 2 * 48 * 3072;
    assert_clipped(at, "clipped.crsd", values, [-32768.0, 32767.0]);
}

/// Samples outside the sub-swaths, pulses of calibration and unused codes contribute to no estimate.
#[test]
fn defects_of_l0b_samples_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    python_with("l0b_write.py", at, &["defects"]);
    let clean = defects(&at.join("noise.h5"));
    assert_eq!(clean.0, []);
    // Two pulses of calibration are left out.
    assert_eq!(clean.1.len(), 1, "{:?}", clean.1);
    // 148 pulses of 950 samples. Row 30 of the file is pulse 29.
    let (found, warnings) = defects(&at.join("unbalanced.h5"));
    let expected = Unbalanced {
        deviation: 0.5,
        bias: Complex64::new(0.15, -0.1),
        samples: 145.0 * 950.0,
        channel: "A-HH",
        pulses: 148,
        first_zero: 30,
    };
    expected.check(&found);
    let zeros = "3 of 148 pulses contain only zeros, the first is pulse 30:";
    assert_texts(&warnings, "NISAR L0B", zeros);
    let limit = 127.5 / 32.0;
    assert_clipped(at, "clipped.h5", 2 * 148 * 950, [-limit, limit]);
}

fn zero_pulses(count: usize, first_pulse: usize) -> DefectKind {
    DefectKind::ZeroPulses {
        count,
        first_pulse,
        channels: 1,
        left_out: false,
    }
}

/// Pulses 10 to 12 of 32 are not in the file, and its pulses 3 and 20 contain only zeros.
#[test]
fn missing_and_zero_vectors_of_cphd_are_reported() {
    let scene = Scene::default();
    let width = scene.num_samples;
    let mut collection = scene.collection();
    let mut samples = scene.samples();
    collection.pulses.drain(10..13);
    samples.drain(10 * width..13 * width);
    for n in [3, 20] {
        samples[n * width..(n + 1) * width].fill(Default::default());
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gaps.cphd");
    let history = InMemory::new(collection, samples).unwrap();
    let channels = [Channel::new("one", &history)];
    write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
    let (found, warnings) = defects(&path);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    let [gaps, zeros] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(gaps.examined.channel.as_deref(), Some("one"));
    let DefectKind::Gaps {
        missing_pulses: 3,
        gaps: 1,
        after_pulse: 9,
        share,
        ..
    } = gaps.kind
    else {
        panic!("{gaps:?}");
    };
    assert!((share - 3.0 / 32.0).abs() < 1e-12);
    assert_eq!(zeros.kind, zero_pulses(2, 3));
    let text = "2 of 29 pulses contain only zeros, the first is pulse 3: the normalisation of the image counts them";
    assert!(warnings[1].ends_with(text), "{warnings:?}");
}

/// 40 pulses at a rate of 100 Hz without those of 0.1 and 0.11 s; pulses 5 to 7 contain only zeros.
#[test]
fn missing_and_zero_pulses_of_arrays_are_reported() {
    let numbers: Vec<u32> = (0..42).filter(|n| ![10, 11].contains(n)).collect();
    let float = |values: Vec<f64>| -> Vec<u8> {
        values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect()
    };
    let times = numbers.iter().map(|&n| f64::from(n) * 0.01).collect();
    let antenna = (numbers.iter().flat_map(|&n| [f64::from(n), -500.0, 300.0])).collect();
    let samples = (0..40 * 2 * 2).map(|i| f64::from(!(5 * 4..8 * 4).contains(&i)));
    let members = [
        (
            "samples.npy",
            array("<c16", "(40, 2)", &float(samples.collect())),
        ),
        (
            "frequency_hz.npy",
            array("<f8", "(2,)", &float(vec![1e9, 1.01e9])),
        ),
        ("antenna_m.npy", array("<f8", "(40, 3)", &float(antenna))),
        ("time_s.npy", array("<f8", "(40,)", &float(times))),
        ("sign.npy", array("<f8", "()", &float(vec![-1.0]))),
        (
            "reference_path_m.npy",
            array("<f8", "()", &float(vec![0.0])),
        ),
    ];
    let members: Vec<(&str, &[u8])> = members
        .iter()
        .map(|(name, data)| (*name, &data[..]))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gaps.npz");
    std::fs::write(&path, stored(&members)).unwrap();
    let (found, warnings) = defects(&path);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    let [gaps, zeros] = &found[..] else {
        panic!("{found:?}");
    };
    let expected = "2 pulses are missing in 1 gap of the pulse times, the first of 30 ms after pulse 9 at 0.090000 s (usual interval 10 ms)";
    assert_eq!(gaps.to_string(), expected);
    assert_eq!(zeros.kind, zero_pulses(3, 5));
}

/// Pulse 1 of 3 contains only zeros.
#[test]
fn zero_pulses_of_gotcha_are_reported() {
    let mut fields = gotcha_fields();
    let Value::Complex(.., re, im) = &mut fields[0].1 else {
        panic!("{:?}", fields[0]);
    };
    re[4..8].fill(0.0);
    im[4..8].fill(0.0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("zeros.mat");
    std::fs::write(&path, gotcha(fields)).unwrap();
    let (found, warnings) = defects(&path);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].kind, zero_pulses(1, 1));
    let text = "1 of 3 pulses contain only zeros";
    assert!(
        warnings.iter().any(|warning| warning.contains(text)),
        "{warnings:?}"
    );
}
