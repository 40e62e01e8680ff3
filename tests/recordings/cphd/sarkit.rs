//! Files of every kind checked by sarkit: its consistency checks, and its reading of the samples.
//!
//! Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use subaperture::io::cphd::{Channel, Domain, Sgn, WriteOptions, describes_antennas, write};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture::radar::Pattern;
use subaperture::simulate::{Preset, Variation};
use subaperture_tests::experiment::{FLIGHT, IDEAL, Line, PAIR, antenna, experiment, five_points};

use super::scene::{ORIGIN, Scene, TRACK, read_all};

const HINT: &str = "install it with: python3 -m pip install 'sarkit[verification]'";

/// Files written so far, in the form of the script's list.
struct Files {
    folder: tempfile::TempDir,
    list: String,
}

impl Files {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            list: String::new(),
        }
    }

    fn add(&mut self, name: &str, domain: Domain, sgn: Sgn, scenes: &[(&str, Scene)]) {
        let recorded: Vec<_> = scenes.iter().map(|(_, s)| s.recorded()).collect();
        let histories: Vec<(&str, &dyn PhaseHistory)> = scenes
            .iter()
            .zip(&recorded)
            .map(|((id, _), history)| (*id, history as &dyn PhaseHistory))
            .collect();
        self.add_histories(name, domain, sgn, &histories, "");
    }

    fn add_histories(
        &mut self,
        name: &str,
        domain: Domain,
        sgn: Sgn,
        histories: &[(&str, &dyn PhaseHistory)],
        undefined: &str,
    ) {
        let folder = self.folder.path();
        let path = folder.join(format!("{name}-{domain}{sgn}.cphd"));
        let channels: Vec<_> = histories
            .iter()
            .map(|(id, history)| Channel::new(*id, *history))
            .collect();
        let options = WriteOptions {
            domain,
            sgn,
            ..WriteOptions::default()
        };
        write(&path, &channels, &options, &Silent).unwrap();
        for (id, history) in histories {
            let dump = folder.join(format!("{name}-{id}.bin"));
            self.dump(&dump, *history);
            let (path, dump) = (path.display(), dump.display());
            writeln!(self.list, "{path}\t{id}\t{dump}\t{undefined}").unwrap();
        }
    }

    fn dump(&self, path: &Path, history: &dyn PhaseHistory) {
        let samples = read_all(history).unwrap();
        let bytes: Vec<u8> = samples
            .iter()
            .flat_map(|z| [z.re.to_le_bytes(), z.im.to_le_bytes()].concat())
            .collect();
        std::fs::write(path, bytes).unwrap();
    }

    fn check(&self) {
        let list = self.folder.path().join("list.txt");
        std::fs::write(&list, &self.list).unwrap();
        let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
        let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("python/cphd_check.py");
        let output = Command::new(&python)
            .arg(script)
            .arg(&list)
            .output()
            .unwrap_or_else(|e| panic!("cannot run {python:?} ({e}) with sarkit; {HINT}"));
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        println!("{text}");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{text}{errors}");
    }
}

#[test]
fn sarkit_accepts_every_kind_of_file() {
    let plain = Scene::default();
    let bistatic = Scene {
        receiver: |t| DVec3::new(4000.0, -3500.0 + 60.0 * t, 900.0),
        ..plain
    };
    let fixed_receiver = Scene {
        receiver: |_| DVec3::new(30.0, -200.0, 40.0),
        ..plain
    };
    // A moving reference point: a stripmap.
    let strip = Scene {
        reference: |t| DVec3::new(125.0 * t - 3.0, 0.0, 0.0),
        num_samples: 25,
        extent: false,
        ..plain
    };
    let left_looking = Scene {
        transmitter: |t| DVec3::new(3.0 - 125.0 * t, -5000.0, 1500.0),
        receiver: |t| DVec3::new(3.0 - 125.0 * t, -5000.0, 1500.0),
        ..plain
    };
    let biased = Scene {
        path_bias_m: 0.8e-3,
        ..plain
    };
    let other = Scene {
        num_pulses: 20,
        num_samples: 33,
        start_hz: 1.2e9,
        step_hz: 2e6,
        receiver: |t| TRACK(t) + DVec3::new(0.2, 0.1, 0.0),
        ..plain
    };
    let mut files = Files::new();
    for domain in [Domain::Fx, Domain::Toa] {
        for sgn in [Sgn::Minus, Sgn::Plus] {
            files.add("plain", domain, sgn, &[("1", plain)]);
            files.add("bistatic", domain, sgn, &[("1", bistatic)]);
            files.add("strip", domain, sgn, &[("1", strip)]);
            files.add("two", domain, sgn, &[("A", plain), ("B", other)]);
        }
        files.add(
            "fixed-receiver",
            domain,
            Sgn::Minus,
            &[("1", fixed_receiver)],
        );
        files.add("left", domain, Sgn::Minus, &[("1", left_looking)]);
        files.add("biased", domain, Sgn::Minus, &[("1", biased)]);
        files.add(
            "two-bands",
            domain,
            Sgn::Minus,
            &[("B", other), ("A", bistatic)],
        );
    }
    files.check();
}

/// True positions as added parameters, with a recorded track that differs.
#[test]
fn sarkit_accepts_true_positions() {
    let mut array = experiment(IDEAL, five_points());
    array.measured = Some(Arc::new(Line {
        sway_m: 0.05,
        ..FLIGHT
    }));
    array.radar.receivers = vec![
        antenna("R0", DVec3::ZERO),
        antenna("R1", DVec3::new(-0.2, 0.0, 0.0)),
    ];
    let recordings: Vec<_> = array
        .pairs()
        .into_iter()
        .map(|pair| array.record(pair).unwrap())
        .collect();
    let mut files = Files::new();
    for domain in [Domain::Fx, Domain::Toa] {
        let channels: [(&str, &dyn PhaseHistory); 2] =
            [("R0", &recordings[0]), ("R1", &recordings[1])];
        files.add_histories("truth", domain, Sgn::Minus, &channels, "");
    }
    files.check();
}

/// Antennas as gain polynomials about axes that are polynomials of time.
#[test]
fn sarkit_accepts_antenna_patterns() {
    let mut looking = experiment(IDEAL, five_points());
    looking.radar.transmitters[0].pattern = Pattern::Gaussian {
        azimuth_rad: 0.3,
        elevation_rad: 0.6,
    };
    let recording = looking.record(PAIR).unwrap();
    let mut carried = recording.echoes().carried();
    let count = carried.attitudes.len() as f64;
    for (n, attitudes) in carried.attitudes.iter_mut().enumerate() {
        attitudes[0] *= DQuat::from_rotation_z(0.05 * n as f64 / count);
    }
    let mut files = Files::new();
    let path = files.folder.path().join("antennas.cphd");
    let dump = files.folder.path().join("antennas.bin");
    let channel = Channel::new("1", &recording).with_antennas(carried);
    assert!(describes_antennas(&channel));
    write(&path, &[channel], &WriteOptions::default(), &Silent).unwrap();
    files.dump(&dump, &recording);
    writeln!(files.list, "{}\t1\t{}\t", path.display(), dump.display()).unwrap();
    files.check();
}

/// Geometries whose angles are at the ends of their ranges, as in textbook tables.
#[test]
fn sarkit_accepts_limits_of_geometry() {
    let plain = Scene {
        num_pulses: 130,
        num_samples: 8,
        ..Scene::default()
    };
    let mut files = Files::new();
    // Motion exactly along the line of sight defines no slant plane; sarkit computes 0 / 0.
    let no_plane = "TwistAngle,SlopeAngle,LayoverAngle";
    for (name, preset, undefined) in [
        ("table-2-1", Preset::Table21, no_plane),
        ("table-4-1", Preset::Table41, ""),
    ] {
        let simulated = preset.simulate(&Variation::default());
        let channels: [(&str, &dyn PhaseHistory); 1] = [("1", &simulated)];
        files.add_histories(name, Domain::Fx, Sgn::Minus, &channels, undefined);
    }
    let mut add = |name: &str, track: fn(f64) -> DVec3, reference: fn(f64) -> DVec3| {
        let scene = Scene {
            transmitter: track,
            receiver: track,
            reference,
            ..plain
        };
        files.add(name, Domain::Fx, Sgn::Minus, &[("1", scene)]);
    };
    // Graze 0, broadside, along either axis in both directions.
    add(
        "flat-x",
        |t| DVec3::new(125.0 * t - 30.0, -5000.0, 0.0),
        ORIGIN,
    );
    add(
        "flat-y",
        |t| DVec3::new(-5000.0, 30.0 - 125.0 * t, 0.0),
        ORIGIN,
    );
    add(
        "flat-north",
        |t| DVec3::new(125.0 * t - 30.0, 5000.0, 0.0),
        ORIGIN,
    );
    let strip: fn(f64) -> DVec3 = |t| DVec3::new(125.0 * t, 0.0, 0.0);
    add("flat-strip", |t| DVec3::new(125.0 * t, -5000.0, 0.0), strip);
    // Due north of the scene, azimuth 0 at all times.
    add(
        "north-strip",
        |t| DVec3::new(125.0 * t, 5000.0, 2000.0),
        strip,
    );
    // Towards the scene in level flight: the slant plane is vertical.
    add(
        "forward",
        |t| DVec3::new(0.0, -5000.0 + 125.0 * t, 1500.0),
        ORIGIN,
    );
    // A short rail.
    add("rail", |t| DVec3::new(t - 0.35, -12.0, 1.1), ORIGIN);
    files.check();
}
