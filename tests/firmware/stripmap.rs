//! An image of a stripmap of 10,000 pulses, accumulated by the firmware under emulation: the bytes from the module are a hundredth of those
//! to it. Five to ten minutes for each arithmetic.

use crate::emulated::application;
use serde_json::{Value, json};
use subaperture::io::npy;
use subaperture_tests::error_db;
use subaperture_tests::subap::{run, write_recording};

const SCENARIO: &str = r#"
name = "strip"

[scene]
reference_range = "5 km"
x = "-150, 150 m"
y = "-8, 8 m"

[[scene.point]]
position = "-130, 3, 0 m"

[[scene.point]]
position = "0, -4, 0 m"

[[scene.point]]
position = "120, 0, 0 m"

[radar]
kind = "ideal"
pulses = 10000
pri = "1 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 128

[[radar.transmitter]]
boresight = "0, -1, 0"
pattern = "gaussian"
azimuth = "2 deg"
elevation = "20 deg"

[[radar.receiver]]
boresight = "0, -1, 0"
pattern = "gaussian"
azimuth = "2 deg"
elevation = "20 deg"

[platform]
kind = "linear"
position = "0, 5, 0 km"
velocity = "120, 0, 0 m/s"
"#;

const GRID: &str = "x=-150:150:1,y=-8:8:1,z=0";

#[test]
#[ignore = "minutes: cargo xtask long"]
fn image_of_10000_pulses_takes_a_hundredth_of_their_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_recording(at, "strip", SCENARIO);
    // The module adds all pulses to all pixels.
    let line = format!("focus strip.cphd -a rdbp --beam none --error-db -80 --grid {GRID} -o host");
    run(at, &line).succeeded();
    let image = |name: &str| npy::read(&at.join(name).join("image.npy")).unwrap();
    let arithmetics = ["float", "fixed"].iter().zip(application());
    for ((arithmetic, elf), most_db) in arithmetics.zip([-60.0, -55.0]) {
        let line = format!(
            "link emulate:{arithmetic} strip.cphd --send image -o {arithmetic} --grid {GRID} --verify --json --firmware {}",
            elf.display()
        );
        let report: Value = serde_json::from_str(run(at, &line).succeeded()).unwrap();
        let ratio = report["down_up_ratio"].as_f64().unwrap();
        let measured_db = error_db(&image(arithmetic), &image("host"));
        println!("{arithmetic}: {measured_db:.1} dB, ratio {ratio:.4}");
        let pixels = 300 * 16;
        assert_eq!(
            report["verified"],
            json!({ "same": pixels, "different": 0 })
        );
        assert!(measured_db <= most_db, "{arithmetic}: {measured_db}");
        assert!(ratio <= 0.01, "{arithmetic}: {ratio}");
    }
}
