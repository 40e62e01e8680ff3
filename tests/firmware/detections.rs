//! Targets that the emulated module detects, by the command: three moving targets in clutter.

use crate::emulated::application;
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
pulses = 256
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

/// Two-way path in metres and its rate in metres per second, `after_s` seconds after the middle of the collection.
fn path(position_m: [f64; 3], velocity_m_s: [f64; 3], after_s: f64) -> (f64, f64) {
    let radar_m = [125.0 * after_s, -5000.0, 3000.0];
    let radar_m_s = [125.0, 0.0, 0.0];
    let line: [f64; 3] =
        std::array::from_fn(|i| position_m[i] + velocity_m_s[i] * after_s - radar_m[i]);
    let range_m = line.iter().map(|x| x * x).sum::<f64>().sqrt();
    let closing: f64 = (0..3)
        .map(|i| line[i] * (velocity_m_s[i] - radar_m_s[i]))
        .sum();
    (2.0 * range_m, 2.0 * closing / range_m)
}

/// A cell is `c / B` of path, 2 m, by the wavelength over the duration of a sub-CPI of path rate.
#[test]
fn three_movers_in_clutter_are_detected_within_a_cell() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("movers.toml"), SCENE).unwrap();
    run(folder.path(), "simulate movers.toml -o movers.cphd").succeeded();
    let line = format!(
        "link emulate:float movers.cphd --send detections -o movers.csv --grid x=-10:10:0.5,y=-10:10:0.5,z=0 \
         --json --firmware {}",
        application()[0].display()
    );
    let ran = run(folder.path(), &line);
    let report: serde_json::Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert!(ran.is_untroubled(), "{ran:?}");
    let ratio = report["down_up_ratio"].as_f64().unwrap();
    println!("ratio {ratio:.4}, {} detections", report["detections"]);
    assert!(ratio <= 0.01, "{ratio}");

    let table = std::fs::read_to_string(folder.path().join("movers.csv")).unwrap();
    let mut lines = table.lines().skip(1);
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| names.iter().position(|other| *other == name).unwrap();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| {
            line.split(',')
                .map(|value| value.parse().unwrap_or(f64::NAN))
                .collect()
        })
        .collect();
    let [sub_cpi, time, path_column, rate, snr] =
        ["sub_cpi", "time_s", "path_m", "path_rate_m_s", "snr_db"].map(column);
    let mut times: Vec<(f64, f64)> = rows.iter().map(|row| (row[sub_cpi], row[time])).collect();
    times.dedup();
    let sub_cpis = times.len();
    // Pulses are 0 to 255, a millisecond apart.
    let middle_s = 0.1275;
    let cells = [2.0, 0.03 / (0.256 / sub_cpis as f64)];
    for (position_m, velocity_m_s) in MOVERS {
        for &(number, time_s) in &times {
            let (path_m, rate_m_s) = path(position_m, velocity_m_s, time_s - middle_s);
            let named = rows.iter().find(|row| {
                row[sub_cpi] == number
                    && (row[path_column] - path_m).abs() <= cells[0]
                    && (row[rate] - rate_m_s).abs() <= cells[1]
            });
            let named = named.unwrap_or_else(|| {
                panic!("no detection of {position_m:?} in sub-CPI {number}: {path_m} {rate_m_s}\n{table}")
            });
            assert!(named[snr] > 10.0, "{named:?}");
        }
    }
}
