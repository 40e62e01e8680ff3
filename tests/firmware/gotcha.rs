//! A real recording through the firmware under emulation, by the commands: the image equals that of the host's former, whether the module
//! sends maps or accumulates the image. Each run takes half a minute.

use std::path::Path;

use crate::emulated::application;
use subaperture::image::Image;
use subaperture::io::npy;
use subaperture_tests::error_db;
use subaperture_tests::subap::{root, run};

const GRID: &str = "x=-10:10:0.2,y=-10:10:0.2,z=0";

fn image(folder: &Path, line: &str) -> Image {
    let ran = run(folder, &format!("focus {line} --grid {GRID} --out image"));
    ran.succeeded();
    assert!(ran.is_untroubled(), "{ran:?}");
    npy::read(&folder.join("image/image.npy")).unwrap()
}

#[test]
fn image_of_one_degree_through_module_equals_host_image() {
    let input = root().join("../shared/data/gotcha/data_3dsar_pass1_az001_HH.mat");
    if !input.exists() {
        println!("skipped: {} not found", input.display());
        return;
    }
    let input = input.display();
    let folder = tempfile::tempdir().unwrap();
    let own = image(folder.path(), &format!("{input}"));
    for (arithmetic, elf) in ["float", "fixed"].iter().zip(application()) {
        let line = format!(
            "link emulate:{arithmetic} {input} -o {arithmetic}.maps --grid {GRID} --verify --firmware {}",
            elf.display()
        );
        let ran = run(folder.path(), &line);
        println!("{}", ran.succeeded());
        assert!(ran.stdout.contains("on this computer, 0 not"), "{ran:?}");
        assert!(ran.is_untroubled(), "{ran:?}");
        let linked = image(folder.path(), &format!("--from-maps {arithmetic}.maps"));
        let measured_db = error_db(&linked, &own);
        println!("{arithmetic}: {measured_db:.1} dB");
        assert!(measured_db <= -60.0, "{arithmetic}: {measured_db}");
    }
}

/// 10 m by 10 m, accumulated on the module: the bytes from it are a tenth of those to it or fewer.
#[test]
fn image_accumulated_by_module_equals_host_image() {
    const GRID: &str = "x=-5:5:0.2,y=-5:5:0.2,z=0";
    let input = root().join("../shared/data/gotcha/data_3dsar_pass1_az001_HH.mat");
    if !input.exists() {
        println!("skipped: {} not found", input.display());
        return;
    }
    let input = input.display();
    let folder = tempfile::tempdir().unwrap();
    let image = |line: &str, out: &str| {
        let ran = run(folder.path(), line);
        ran.succeeded();
        assert!(ran.is_untroubled(), "{ran:?}");
        let image = npy::read(&folder.path().join(out).join("image.npy")).unwrap();
        (ran, image)
    };
    let (_, host) = image(
        &format!("focus {input} -a rdbp --error-db -80 --grid {GRID} -o host"),
        "host",
    );
    for ((arithmetic, elf), most_db) in ["float", "fixed"]
        .iter()
        .zip(application())
        .zip([-60.0, -55.0])
    {
        let line = format!(
            "link emulate:{arithmetic} {input} --send image -o {arithmetic} --grid {GRID} --verify --json --firmware {}",
            elf.display()
        );
        let (ran, accumulated) = image(&line, arithmetic);
        let report: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        let ratio = report["down_up_ratio"].as_f64().unwrap();
        let measured_db = error_db(&accumulated, &host);
        println!("{arithmetic}: {measured_db:.1} dB, ratio {ratio:.3}");
        assert_eq!(
            report["verified"],
            serde_json::json!({ "same": 50 * 50, "different": 0 })
        );
        assert!(measured_db <= most_db, "{arithmetic}: {measured_db}");
        assert!(ratio <= 0.1, "{arithmetic}: {ratio}");
    }
}
