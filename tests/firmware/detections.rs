//! Targets that the emulated module detects, by the command: three moving targets in clutter.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use crate::emulated::{Begin, Emulated, Wire, application};
use crate::sessions::{complete, settings};
use subaperture::module::link::{Buffers, ChannelDetection, DetectionSink, Session, SinkError};
use subaperture::monitor::Silent;
use subaperture_core::link::Encoding;
use subaperture_tests::dpca_scene;
use subaperture_tests::subap::run;

const SCENE: &str = r#"
name = "three movers in clutter"
seed = 5

[scene]
x = "-12, 12 m"
y = "-12, 12 m"

[[scene.clutter]]
x = "-20, 20 m"
y = "-20, 20 m"
density = 2
sigma0 = "-20 dB"

[[scene.mover]]
kind = "linear"
position = "-6, 2, 0 m"
velocity = "0, 1.2, 0 m/s"
cross_section = "10 m^2"

[[scene.mover]]
kind = "linear"
position = "5, -4, 0 m"
velocity = "0, -1.3, 0 m/s"
cross_section = "10 m^2"

[[scene.mover]]
kind = "linear"
position = "2, 7, 0 m"
velocity = "0.5, -1.1, 0 m/s"
cross_section = "10 m^2"

[radar]
kind = "ideal"
pulses = 128
pri = "1 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 256
motion = "true"

[platform]
kind = "linear"
position = "0, -5, 3 km"
velocity = "125, 0, 0 m/s"
"#;

/// Positions at the middle of the collection in metres, and velocities in metres per second, as in the scene.
const MOVERS: [([f64; 3], [f64; 3]); 3] = [
    ([-6.0, 2.0, 0.0], [0.0, 1.2, 0.0]),
    ([5.0, -4.0, 0.0], [0.0, -1.3, 0.0]),
    ([2.0, 7.0, 0.0], [0.5, -1.1, 0.0]),
];

/// Two receivers instead of the antenna of the platform, 0.5 m apart along the track.
const RECEIVERS: &str = r#"
[[radar.transmitter]]
offset = "0, 0, 0 m"

[[radar.receiver]]
offset = "0.25, 0, 0 m"

[[radar.receiver]]
offset = "-0.25, 0, 0 m"
"#;

/// Places of the receivers along the track in metres.
const ALONG_M: [f64; 2] = [0.25, -0.25];

/// Two-way path in metres from the platform to a receiver `along_m` metres ahead of it, and the path rate in metres per second,
/// `after_s` seconds after the middle of the collection.
fn path(along_m: f64, position_m: [f64; 3], velocity_m_s: [f64; 3], after_s: f64) -> (f64, f64) {
    let legs = [0.0, along_m].map(|ahead_m| {
        let antenna_m = [125.0 * after_s + ahead_m, -5000.0, 3000.0];
        let antenna_m_s = [125.0, 0.0, 0.0];
        let line: [f64; 3] =
            std::array::from_fn(|i| position_m[i] + velocity_m_s[i] * after_s - antenna_m[i]);
        let range_m = line.iter().map(|x| x * x).sum::<f64>().sqrt();
        let rate: f64 = (0..3)
            .map(|i| line[i] * (velocity_m_s[i] - antenna_m_s[i]))
            .sum();
        (range_m, rate / range_m)
    });
    (legs[0].0 + legs[1].0, legs[0].1 + legs[1].1)
}

/// Rows of a table of detections, with access by the name of a column.
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    fn read(text: &str) -> Self {
        let mut lines = text.lines().skip(1);
        let names = lines.next().unwrap().split(',').map(str::to_owned);
        let number = |value: &str| value.parse().unwrap_or(f64::NAN);
        Self {
            names: names.collect(),
            rows: lines
                .map(|line| line.split(',').map(number).collect())
                .collect(),
        }
    }

    fn at(&self, row: &[f64], name: &str) -> f64 {
        row[self.names.iter().position(|other| other == name).unwrap()]
    }
}

/// Detect the targets of `scene` on an emulated module, in one channel or all of them.
fn detected(scene: &str, (arithmetic, elf): (&str, &Path), options: &str) -> Table {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("movers.toml"), scene).unwrap();
    run(folder.path(), "simulate movers.toml -o movers.cphd").succeeded();
    let line = format!(
        "link emulate:{arithmetic} movers.cphd --send detections -o movers.csv --grid x=-10:10:0.5,y=-10:10:0.5,z=0 \
         --json --firmware {} {options}",
        elf.display()
    );
    let ran = run(folder.path(), &line);
    let report: serde_json::Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert!(ran.is_untroubled(), "{ran:?}");
    let ratio = report["down_up_ratio"].as_f64().unwrap();
    println!("ratio {ratio:.4}, {} detections", report["detections"]);
    // The status of the module is a large share of these short runs.
    assert!(ratio <= 0.02, "{ratio}");
    Table::read(&std::fs::read_to_string(folder.path().join("movers.csv")).unwrap())
}

/// Detections of a target, at most one per sub-CPI, within a cell: `c / B` of path, 2 m, by the wavelength over the duration of a
/// sub-CPI of path rate. Each with the time after the middle of the collection. And the number of sub-CPIs.
fn named(
    (table, pulses): (&Table, usize),
    along_m: f64,
    (position_m, velocity_m_s): ([f64; 3], [f64; 3]),
) -> (Vec<(f64, &[f64])>, usize) {
    let time = |row: &Vec<f64>| (table.at(row, "sub_cpi"), table.at(row, "time_s"));
    let mut times: Vec<(f64, f64)> = table.rows.iter().map(time).collect();
    times.dedup();
    // Pulses are a millisecond apart.
    let duration_s = 1e-3 * pulses as f64;
    let middle_s = (duration_s - 1e-3) / 2.0;
    let cells = [2.0, 0.03 / (duration_s / times.len() as f64)];
    let of_sub_cpi = times.iter().filter_map(|&(number, time_s)| {
        let after_s = time_s - middle_s;
        let (path_m, rate_m_s) = path(along_m, position_m, velocity_m_s, after_s);
        let row = table.rows.iter().find(|row| {
            table.at(row, "sub_cpi") == number
                && (table.at(row, "path_m") - path_m).abs() <= cells[0]
                && (table.at(row, "path_rate_m_s") - rate_m_s).abs() <= cells[1]
        })?;
        assert!(table.at(row, "snr_db") > 10.0, "{row:?}");
        Some((after_s, row.as_slice()))
    });
    (of_sub_cpi.collect(), times.len())
}

#[test]
fn three_movers_in_clutter_are_detected_within_a_cell() {
    let table = detected(SCENE, ("float", &application()[0]), "");
    for mover in MOVERS {
        let (found, sub_cpis) = named((&table, 128), 0.0, mover);
        assert_eq!(found.len(), sub_cpis, "{mover:?}");
    }
}

/// Phases of a target at rest are equal in both channels, those of movers differ as their paths do: by the difference between the
/// paths from both receivers to the mover and to the point at rest of equal path and rate.
#[test]
fn phases_of_two_channels_give_the_motion_of_the_target() {
    let at_rest = ([-2.0, -7.0, 0.0], [0.0; 3]);
    let scene = format!(
        "{SCENE}{RECEIVERS}\n[[scene.mover]]\nkind = \"linear\"\nposition = \"-2, -7, 0 m\"\n\
         velocity = \"0, 0, 0 m/s\"\ncross_section = \"10 m^2\"\n"
    );
    let table = detected(&scene, ("fixed", &application()[1]), "--channels all");
    for (position_m, velocity_m_s) in MOVERS.into_iter().chain([at_rest]) {
        let (found, sub_cpis) = named((&table, 128), ALONG_M[0], (position_m, velocity_m_s));
        // Sub-CPIs of half as many pulses: speckle hides a target now and then.
        assert!(
            2 * found.len() > sub_cpis,
            "{position_m:?}: {} of {sub_cpis}",
            found.len()
        );
        for (after_s, row) in found {
            let rest_m = ["x_m", "y_m", "z_m"].map(|name| table.at(row, name));
            let extra_m = ALONG_M.map(|along_m| {
                path(along_m, position_m, velocity_m_s, after_s).0
                    - path(along_m, rest_m, [0.0; 3], after_s).0
            });
            let expected_rad = -TAU * 10e9 / 299_792_458.0 * (extra_m[1] - extra_m[0]);
            let phases = ["phase_1_rad", "phase_2_rad"].map(|name| table.at(row, name));
            let error_rad = phases[1] - phases[0] - expected_rad;
            let error_rad = error_rad - TAU * (error_rad / TAU).round();
            println!("{velocity_m_s:?}: {expected_rad:.3} rad, error {error_rad:.3}");
            assert!(error_rad.abs() < 0.1, "{row:?}");
            let powers = ["power_1_db", "power_2_db"].map(|name| table.at(row, name));
            assert!((powers[1] - powers[0]).abs() < 1.0, "{row:?}");
        }
    }
}

/// Lists of detections by sub-CPI and patch.
#[derive(Default)]
struct Lists(BTreeMap<(u32, u16), Vec<ChannelDetection>>);

impl DetectionSink for Lists {
    fn accept(
        &mut self,
        sub_cpi: u32,
        patch: u16,
        list: &[ChannelDetection],
    ) -> Result<(), SinkError> {
        self.0.insert((sub_cpi, patch), list.to_vec());
        Ok(())
    }
}

/// Detections after clutter cancellation have the same bits on the module as by the core on this machine, in both arithmetics.
#[test]
fn cancelled_detections_of_the_module_equal_those_of_the_core() {
    let recordings = dpca_scene::recordings();
    let detector = dpca_scene::detector(&recordings);
    for (encoding, elf) in [Encoding::Complex32, Encoding::Sc16]
        .iter()
        .zip(application())
    {
        let own = &mut dpca_scene::job(&recordings, &detector, *encoding);
        let expected = dpca_scene::expected_of(own, &detector);
        let mut job = dpca_scene::job(&recordings, &detector, *encoding);
        let mut module = Emulated::connected(elf, Wire::Tcp, Begin::Reset);
        let (mut buffers, mut lists) = (Buffers::new(), Lists::default());
        let mut session =
            Session::open(&mut module, &mut buffers, settings(100), &mut Silent).unwrap();
        let outcome = session.detect(&mut job, &detector, &mut lists, &mut Silent);
        complete(&outcome);
        assert_eq!(lists.0, expected);
        assert!(lists.0.values().map(Vec::len).sum::<usize>() > 50);
    }
}

/// With the clutter cancelled a target at rest of 10 m^2 is not detected. A mover is, with half of the path rate that its own motion adds as radial velocity.
///
/// The difference has `4 sin^2(phi / 2)` of a mover's power `S` and twice the noise `N` of a channel. The phase has the variance `N / S`. Its error is below
/// four standard deviations and the 0.1 rad of clutter in the cell that
/// `phases_of_two_channels_give_the_motion_of_the_target` allows.
#[test]
fn cancellation_leaves_a_mover_with_its_radial_velocity() {
    const PULSES: usize = 64;
    let at_rest = ([-2.0, -7.0, 0.0], [0.0; 3]);
    // Movers within each other's training cells would hide each other: the first one only.
    let [head, first, .., last] = SCENE.split("[[scene.mover]]").collect::<Vec<_>>()[..] else {
        panic!("a scene of three movers");
    };
    let radar = &last[last.find("[radar]").unwrap()..];
    let radar = radar.replace("pulses = 128", &format!("pulses = {PULSES}"));
    let scene = format!(
        "{head}[[scene.mover]]{first}[[scene.mover]]\nkind = \"linear\"\nposition = \"-2, -7, 0 m\"\nvelocity = \"0, 0, 0 m/s\"\n\
         cross_section = \"10 m^2\"\n\n{radar}{RECEIVERS}\n[radar.noise]\npower = \"0 dB\"\n"
    );
    let elf = ("fixed", application()[1].as_path());
    let before = detected(&scene, elf, "--channels all");
    let (found, sub_cpis) = named((&before, PULSES), ALONG_M[0], at_rest);
    assert!(2 * found.len() > sub_cpis, "{} of {sub_cpis}", found.len());
    let table = detected(&scene, elf, "--channels all --dpca");
    let (found, _) = named((&table, PULSES), ALONG_M[0], at_rest);
    assert!(found.is_empty(), "{found:?}");

    let (position_m, velocity_m_s) = MOVERS[0];
    let (found, sub_cpis) = named((&table, PULSES), ALONG_M[0], (position_m, velocity_m_s));
    assert!(2 * found.len() > sub_cpis, "{} of {sub_cpis}", found.len());
    // A lag of two pulses: 0.25 m between the phase centres at 125 m/s.
    let metres_s_per_rad = 299_792_458.0 / 10e9 / (2.0 * TAU * 0.002);
    for (after_s, row) in found {
        let rate = |velocity_m_s| path(0.0, position_m, velocity_m_s, after_s).1;
        let expected_m_s = (rate([0.0; 3]) - rate(velocity_m_s)) / 2.0;
        let snr = 10f64.powf(table.at(row, "snr_db") / 10.0);
        let phi = expected_m_s / metres_s_per_rad;
        let channel_snr = 2.0 * snr / (4.0 * (phi / 2.0).sin().powi(2));
        let most_m_s = (4.0 / channel_snr.sqrt() + 0.1) * metres_s_per_rad;
        let measured_m_s = table.at(row, "radial_velocity_m_s");
        println!("{measured_m_s:.3} m/s, expected {expected_m_s:.3} +- {most_m_s:.3}");
        assert!((measured_m_s - expected_m_s).abs() < most_m_s, "{row:?}");
    }
}
