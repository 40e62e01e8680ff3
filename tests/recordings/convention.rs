//! Sign and reference of the phase, inferred from the samples of arrays that do not state them: correct, or refused. Echoes are a float64
//! sum over points written out here.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use subaperture::convention::INFERENCE;
use subaperture::io::open::{self, Options};
use subaperture::phase_history::{Basis, PhaseConvention, PhaseReference, PhaseSign};
use subaperture_tests::numpy::{array, stored};

const C_M_S: f64 = 299_792_458.0;

/// Antennas, frequencies and unit scatterers.
struct Geometry {
    name: &'static str,
    antennas_m: Vec<[f64; 3]>,
    start_hz: f64,
    step_hz: f64,
    frequencies: usize,
    points_m: Vec<[f64; 3]>,
    /// Standard deviation of the noise in real and imaginary part.
    noise: f64,
    /// Whether compensated samples differ visibly between both signs.
    determines_sign: bool,
}

/// Uniform numbers in [0, 1) from a linear congruential generator (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = (self.0.wrapping_mul(6_364_136_223_846_793_005))
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal number (Box and Muller).
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
}

/// Real and imaginary parts of all samples: `exp(sign j 2 pi f (path - reference path) / c)`.
fn samples(geometry: &Geometry, sign: f64, reference_m: Option<[f64; 3]>) -> Vec<f64> {
    let mut random = Random(17);
    let mut all = Vec::new();
    for &antenna_m in &geometry.antennas_m {
        let reference = reference_m.map_or(0.0, |point| 2.0 * distance_m(antenna_m, point));
        for k in 0..geometry.frequencies {
            let frequency_hz = geometry.start_hz + k as f64 * geometry.step_hz;
            let (mut re, mut im) = (0.0, 0.0);
            for &point_m in &geometry.points_m {
                let path_m = 2.0 * distance_m(antenna_m, point_m) - reference;
                let phase = sign * TAU * frequency_hz * path_m / C_M_S;
                re += phase.cos();
                im += phase.sin();
            }
            all.push(re + geometry.noise * random.normal());
            all.push(im + geometry.noise * random.normal());
        }
    }
    all
}

fn bytes(values: &[f64]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

fn write(
    folder: &Path,
    geometry: &Geometry,
    samples: &[f64],
    more: &[(&str, &str, &[f64])],
) -> PathBuf {
    let (pulses, frequencies) = (geometry.antennas_m.len(), geometry.frequencies);
    let hz: Vec<f64> = (0..frequencies)
        .map(|k| geometry.start_hz + k as f64 * geometry.step_hz)
        .collect();
    let antennas = geometry.antennas_m.concat();
    let mut files = vec![
        (
            "samples.npy".to_owned(),
            array(
                "<c16",
                &format!("({pulses}, {frequencies})"),
                &bytes(samples),
            ),
        ),
        (
            "frequency_hz.npy".to_owned(),
            array("<f8", &format!("({frequencies},)"), &bytes(&hz)),
        ),
        (
            "antenna_m.npy".to_owned(),
            array("<f8", &format!("({pulses}, 3)"), &bytes(&antennas)),
        ),
    ];
    for (name, shape, values) in more {
        files.push((format!("{name}.npy"), array("<f8", shape, &bytes(values))));
    }
    let members: Vec<(&str, &[u8])> = files
        .iter()
        .map(|(name, data)| (name.as_str(), data.as_slice()))
        .collect();
    let path = folder.join("mine.npz");
    std::fs::write(&path, stored(&members)).unwrap();
    path
}

fn geometries() -> Vec<Geometry> {
    let line = |count: usize, spacing: f64, at: [f64; 2]| -> Vec<[f64; 3]> {
        (0..count)
            .map(|n| {
                [
                    (n as f64 - (count as f64 - 1.0) / 2.0) * spacing,
                    at[0],
                    at[1],
                ]
            })
            .collect()
    };
    let circle = |count: usize, radius: f64, height: f64, turn: f64| -> Vec<[f64; 3]> {
        (0..count)
            .map(|n| {
                let angle = turn * (n as f64 / count as f64 - 0.5);
                [radius * angle.sin(), -radius * angle.cos(), height]
            })
            .collect()
    };
    let some = vec![[0.0, 0.0, 0.0], [9.0, -4.0, 0.0], [-7.0, 6.0, 0.0]];
    let mut random = Random(5);
    let many = (0..60)
        .map(|_| {
            [
                40.0 * random.uniform() - 20.0,
                40.0 * random.uniform() - 20.0,
                0.0,
            ]
        })
        .collect();
    let spotlight = line(256, 0.5, [-4000.0, 3000.0]);
    let ten_ghz = |name, antennas_m, points_m, determines_sign| Geometry {
        name,
        antennas_m,
        start_hz: 9.5e9,
        step_hz: 2e6,
        frequencies: 128,
        points_m,
        noise: 0.0,
        determines_sign,
    };
    vec![
        ten_ghz("spotlight", spotlight.clone(), some.clone(), false),
        ten_ghz(
            "one point at the origin",
            spotlight.clone(),
            vec![[0.0; 3]],
            false,
        ),
        ten_ghz(
            "one point",
            spotlight.clone(),
            vec![[12.0, 7.0, 0.0]],
            false,
        ),
        ten_ghz("many points", spotlight.clone(), many, false),
        Geometry {
            noise: 8.0,
            ..ten_ghz("noisy", spotlight.clone(), some.clone(), false)
        },
        ten_ghz(
            "uneven pulses",
            spotlight
                .iter()
                .enumerate()
                .filter(|(n, _)| n * n % 7 != 2)
                .map(|(_, a)| *a)
                .collect(),
            some.clone(),
            false,
        ),
        ten_ghz("arc", circle(300, 600.0, 400.0, 0.5), some.clone(), false),
        ten_ghz(
            "full circle",
            circle(720, 300.0, 200.0, TAU),
            some.clone(),
            false,
        ),
        Geometry {
            name: "rail, origin at the rail",
            antennas_m: line(101, 0.01, [0.0, 0.3]),
            start_hz: 5e9,
            step_hz: 10e6,
            frequencies: 128,
            points_m: vec![[0.5, 4.0, 0.0], [-1.0, 6.0, 0.0], [1.5, 8.0, 0.0]],
            noise: 0.0,
            determines_sign: true,
        },
        Geometry {
            name: "rail, origin in the scene",
            antennas_m: line(101, 0.01, [-5.0, 0.3]),
            start_hz: 5e9,
            step_hz: 10e6,
            frequencies: 128,
            points_m: vec![[0.5, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.5, 2.0, 0.0]],
            noise: 0.0,
            determines_sign: false,
        },
        Geometry {
            name: "ultra-wide band",
            antennas_m: line(200, 0.1, [-25.0, 12.0]),
            start_hz: 0.5e9,
            step_hz: 5e6,
            frequencies: 400,
            points_m: some.clone(),
            noise: 0.0,
            determines_sign: false,
        },
    ]
}

/// Inferred convention and warnings of a file whose phase is not fully stated, or the error.
fn opened(path: &Path) -> Result<(PhaseConvention, Vec<String>), String> {
    let options = Options {
        inference: Some(INFERENCE),
        ..Options::default()
    };
    match open::open(path, &options) {
        Ok(history) => Ok((history.phase_conventions()[0], history.warnings())),
        Err(error) => Err(error.to_string()),
    }
}

const ORIGIN: [f64; 3] = [0.0; 3];

fn sign_of(sign: f64) -> PhaseSign {
    match sign > 0.0 {
        true => PhaseSign::Plus,
        false => PhaseSign::Minus,
    }
}

/// Sign and reference are inferred, or for compensated samples the user is asked for the sign.
fn check(geometry: &Geometry) {
    let folder = tempfile::tempdir().unwrap();
    let name = geometry.name;
    for sign in [-1.0, 1.0] {
        for reference_m in [None, Some(ORIGIN)] {
            let samples = samples(geometry, sign, reference_m);
            let path = write(folder.path(), geometry, &samples, &[]);
            let reference = match reference_m {
                None => PhaseReference::Raw,
                Some(_) => PhaseReference::Point(ORIGIN.into()),
            };
            let inferable = reference_m.is_none() || geometry.determines_sign;
            match opened(&path) {
                Ok((found, warnings)) => {
                    assert!(inferable, "{name}, sign {sign}, {reference}: {found}");
                    assert_eq!(
                        (found.sign, found.reference),
                        (sign_of(sign), reference),
                        "{name}"
                    );
                    assert_eq!(
                        (found.sign_basis, found.reference_basis),
                        (Basis::Inferred, Basis::Inferred)
                    );
                    assert_eq!(warnings, Vec::<String>::new());
                }
                Err(error) => {
                    assert!(!inferable, "{name}, sign {sign}, {reference}: {error}");
                    assert!(error.contains("give 'sign', -1 or 1"), "{name}: {error}");
                    // With a stated sign the reference is inferred.
                    let stated = [("sign", "()", &[sign][..])];
                    let (found, _) =
                        opened(&write(folder.path(), geometry, &samples, &stated)).unwrap();
                    assert_eq!(
                        (found.sign, found.reference),
                        (sign_of(sign), reference),
                        "{name}"
                    );
                    assert_eq!(
                        (found.sign_basis, found.reference_basis),
                        (Basis::Stated, Basis::Inferred)
                    );
                }
            }
        }
    }
}

/// Check the geometries of these names.
fn check_all(names: &[&str]) {
    let all = geometries();
    for name in names {
        check(all.iter().find(|geometry| geometry.name == *name).unwrap());
    }
}

#[test]
fn sign_and_reference_of_few_points_are_inferred_or_requested() {
    check_all(&["spotlight", "one point at the origin", "one point"]);
}

#[test]
fn sign_and_reference_in_noise_and_with_uneven_pulses_are_inferred_or_requested() {
    check_all(&["many points", "noisy", "uneven pulses"]);
}

#[test]
fn sign_and_reference_of_bent_apertures_are_inferred_or_requested() {
    check_all(&["arc", "full circle", "ultra-wide band"]);
}

#[test]
fn sign_and_reference_with_origin_on_rail_are_inferred() {
    check_all(&["rail, origin at the rail"]);
}

#[test]
fn sign_and_reference_of_rail_with_origin_in_scene_are_inferred_or_requested() {
    check_all(&["rail, origin in the scene"]);
}

#[test]
fn noise_and_silence_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let spotlight = geometries().swap_remove(0);
    for noise in [1.0, 0.0] {
        let empty = Geometry {
            points_m: Vec::new(),
            noise,
            antennas_m: spotlight.antennas_m.clone(),
            ..spotlight
        };
        let error = opened(&write(
            folder.path(),
            &empty,
            &samples(&empty, -1.0, None),
            &[],
        ))
        .unwrap_err();
        assert!(
            error.contains("give 'sign' (-1 or 1), and 'reference_path_m' (0 for raw echoes)"),
            "{error}"
        );
    }
    // Few pulses give few independent pixels, whose maxima vary more.
    for seed in 0..100 {
        let few = Geometry {
            points_m: Vec::new(),
            noise: 1.0,
            antennas_m: spotlight.antennas_m[..16].to_vec(),
            frequencies: 16,
            ..spotlight
        };
        let mut random = Random(1000 + seed);
        let noise: Vec<f64> = (0..2 * 16 * 16).map(|_| random.normal()).collect();
        let found = opened(&write(folder.path(), &few, &noise, &[]));
        assert!(found.is_err(), "{seed}: {found:?}");
    }
    // A stationary antenna forms no image.
    let standing = Geometry {
        antennas_m: vec![[0.0, -500.0, 300.0]; 64],
        ..geometries().swap_remove(0)
    };
    let error = opened(&write(
        folder.path(),
        &standing,
        &samples(&standing, -1.0, None),
        &[],
    ))
    .unwrap_err();
    assert!(
        error.contains(
            "cannot be inferred (expected antennas that move by at least 4 wavelengths, found less)"
        ),
        "{error}"
    );
}

#[test]
fn phase_must_be_stated_without_inference() {
    let folder = tempfile::tempdir().unwrap();
    let spotlight = geometries().swap_remove(0);
    let path = write(
        folder.path(),
        &spotlight,
        &samples(&spotlight, -1.0, None),
        &[],
    );
    let error = open::open(&path, &Options::default())
        .err()
        .unwrap()
        .to_string();
    assert!(
        error.contains("the phase convention is not stated: give 'sign'"),
        "{error}"
    );
}

#[test]
fn stated_convention_is_used_and_contradiction_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let spotlight = geometries().swap_remove(0);
    let raw = samples(&spotlight, -1.0, None);
    let state = |sign: f64, reference: (&'static str, &'static str, &'static [f64])| {
        let path = write(
            folder.path(),
            &spotlight,
            &raw,
            &[("sign", "()", &[sign]), reference],
        );
        opened(&path).unwrap()
    };
    let path_0: (_, _, &[f64]) = ("reference_path_m", "()", &[0.0]);
    let origin: (_, _, &[f64]) = ("reference_m", "(3,)", &[0.0, 0.0, 0.0]);
    let (found, warnings) = state(-1.0, path_0);
    assert_eq!(
        found,
        PhaseConvention::stated(PhaseSign::Minus, PhaseReference::Raw)
    );
    assert_eq!(warnings, Vec::<String>::new());
    for (sign, reference) in [(1.0, path_0), (-1.0, origin), (1.0, origin)] {
        let (found, warnings) = state(sign, reference);
        assert_eq!(found.sign, sign_of(sign));
        assert_eq!(found.sign_basis, Basis::Stated);
        let [warning] = warnings.as_slice() else {
            panic!("{warnings:?}")
        };
        assert!(
            warning.contains("dB sharper with sign -1, not compensated"),
            "{warning}"
        );
    }
}

/// The image of inferred raw samples shows its points at their positions with unit amplitude.
#[test]
fn image_of_inferred_samples_has_points_at_their_positions() {
    use subaperture::focus::exact::Exact;
    use subaperture::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let spotlight = geometries().swap_remove(0);
    for sign in [-1.0, 1.0] {
        let path = write(
            folder.path(),
            &spotlight,
            &samples(&spotlight, sign, None),
            &[],
        );
        let history = subaperture::open(&path).unwrap();
        for [x, y, _] in &spotlight.points_m {
            let grid: ImageGrid = format!("x={x}:{}:1,y={y}:{}:1", x + 0.5, y + 0.5)
                .parse()
                .unwrap();
            let pixel = Exact.focus(&history, &grid).unwrap().image.pixels[0];
            // Side lobes of the two other points at 10 m and more, with 1.17 m by 0.62 m of resolution and 13 dB at the first: below 0.1
            // each.
            assert!(
                (pixel.norm() - 1.0).abs() < 0.2,
                "{sign}: {pixel} at {x}, {y}"
            );
        }
    }
}

/// A described recording of raw samples without `phase` is read with the sign of its samples; a wrong stated sign is reported.
#[test]
fn sign_of_described_recording_is_inferred_and_contradiction_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let rail = Geometry {
        antennas_m: (0..101)
            .map(|n| [0.02 * (f64::from(n) - 50.0), 0.0, 0.3])
            .collect(),
        ..geometries()
            .into_iter()
            .find(|geometry| geometry.name == "rail, origin at the rail")
            .unwrap()
    };
    let open_with = |sign: f64, phase: &str, inferring: bool| {
        let echoes = array("<c16", "(101, 128)", &bytes(&samples(&rail, sign, None)));
        std::fs::write(folder.path().join("echoes.npy"), echoes).unwrap();
        let text = format!(
            "[recording]\nformat = \"npy\"\nfile = \"echoes.npy\"\n{phase}[scene]\nreference = \"0, 6, 0 m\"\n\
             x = \"-4, 4 m\"\ny = \"2, 10 m\"\n[radar]\nkind = \"stepped\"\nstart = \"5 GHz\"\nstep = \"10 MHz\"\n\
             pri = \"0.1 s\"\n[platform]\nkind = \"rail\"\nfrom = \"-1, 0, 0.3 m\"\nto = \"1, 0, 0.3 m\"\n"
        );
        let path = folder.path().join("rail.toml");
        std::fs::write(&path, text).unwrap();
        match inferring {
            true => opened(&path),
            false => match open::open(&path, &Options::default()) {
                Ok(history) => Ok((history.phase_conventions()[0], history.warnings())),
                Err(error) => Err(error.to_string()),
            },
        }
    };
    for (sign, key) in [(-1.0, "minus"), (1.0, "plus")] {
        let (found, warnings) = open_with(sign, "", true).unwrap();
        assert_eq!(
            (found.sign, found.sign_basis),
            (sign_of(sign), Basis::Inferred)
        );
        assert_eq!(warnings, Vec::<String>::new());
        let stated = format!("phase = \"{key}\"\n");
        let (found, warnings) = open_with(sign, &stated, true).unwrap();
        assert_eq!(
            found,
            PhaseConvention::stated(sign_of(sign), PhaseReference::Raw)
        );
        assert_eq!(warnings, Vec::<String>::new());
        let (found, warnings) = open_with(-sign, &stated, true).unwrap();
        assert_eq!(found.sign, sign_of(sign));
        assert!(warnings[0].contains("[recording] phase is"), "{warnings:?}");
    }
    let error = open_with(-1.0, "", false).unwrap_err();
    assert!(error.contains("give phase = \"minus\""), "{error}");
    // With the opposite sign in samples, that sign is inferred.
    open_with(1.0, "", true).unwrap();
    let history = subaperture::open(folder.path().join("rail.toml")).unwrap();
    let grid = "x=0.5:0.6:1,y=4:4.1:1".parse().unwrap();
    let pixel =
        subaperture::prelude::Focus::focus(&subaperture::focus::exact::Exact, &history, &grid)
            .unwrap();
    assert!((pixel.image.pixels[0].norm() - 1.0).abs() < 0.2);
}
