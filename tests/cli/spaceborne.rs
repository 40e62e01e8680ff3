//! A squinted X-band spotlight from 600 km, whose CPHD declares a surface of constant height above the ellipsoid. Scatterers are projected
//! into its SICD images by the images' own metadata, and back, by NGA's sarkit.

use std::fs;

use glam::DVec3;
use subaperture::io::cphd::{Cphd, ReferenceSurface};
use subaperture_tests::dem::{degree_m, east_north_up_m, ecf_m};
use subaperture_tests::python;
use subaperture_tests::subap::{run, write_recording};

/// Latitude, longitude (degrees), height above the ellipsoid (m) of the scene's origin.
const ORIGIN: [f64; 3] = [-33.4, 149.2, 35.0];

/// A satellite 350 km up, 480 km from the scene, squinted 17 degrees forward; a reflector in metres east, north and up.
fn scenario(reflector: DVec3) -> String {
    format!(
        r#"name = "orbit"
[scene]
reference = "0, 0, 0 m"
x = "-1000, 1000 m"
y = "-1000, 1000 m"
[scene.origin]
latitude = "{} deg"
longitude = "{} deg"
height = "{} m"
[[scene.point]]
position = "{}, {}, {} m"
[radar]
kind = "ideal"
pulses = 200
pri = "12.5 ms"
centre = "9.6 GHz"
bandwidth = "300 MHz"
samples = 6600
[platform]
kind = "linear"
position = "180, -480, 350 km"
velocity = "7500, 0, 0 m/s"
"#,
        ORIGIN[0], ORIGIN[1], ORIGIN[2], reflector.x, reflector.y, reflector.z
    )
}

#[test]
fn sarkit_projects_reflectors_by_sicd_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut list = String::new();
    let [north, east] = degree_m(ORIGIN[0]);
    // Metres north and east of the origin, and above its height.
    for (name, [y, x, z]) in [
        ("near", [8.0, -5.0, 0.0]),
        ("level", [1330.0, -1010.0, 0.0]),
        ("high", [-890.0, 1700.0, 60.0]),
    ] {
        let place = [ORIGIN[0] + y / north, ORIGIN[1] + x / east, ORIGIN[2] + z];
        let (point, local) = (ecf_m(place), east_north_up_m(ORIGIN, place));
        fs::write(at.join(format!("{name}.toml")), scenario(local)).unwrap();
        let line = format!("simulate {name}.toml -o {name}.cphd --reference-surface hae");
        run(at, &line).succeeded();
        let file = Cphd::open(at.join(format!("{name}.cphd")), None, 1 << 28).unwrap();
        assert_eq!(file.info().surface, ReferenceSurface::Hae);
        list += &format!("{}\n", at.join(format!("{name}.cphd")).display());
        // A horizontal plane 3 m below the reflector, with layover; and the slant plane.
        let (x, y, z) = (local.x.round(), local.y.round(), local.z - 3.0);
        for (image, more) in [("level", ""), ("slant", "--surface slant")] {
            let own = format!("{name}_{image}");
            let grid = format!("x=-15:15:0.3,y=-15:15:0.25,cx={x},cy={y},z={z}");
            let line = format!("focus {name}.cphd --grid {grid} {more} --out {own}");
            run(at, &line).succeeded();
            run(at, &format!("export {own} --format sicd -o {own}.nitf")).succeeded();
            let path = at.join(format!("{own}.nitf"));
            let [px, py, pz] = point.to_array();
            list += &format!("{}\t{px}\t{py}\t{pz}\t{}\n", path.display(), place[2]);
        }
        // On the surface itself the position is exact; SICD has no such surface.
        let grid = format!("x=-15:15:0.3,y=-15:15:0.25,cx={x},cy={y}");
        let line = format!(
            "focus {name}.cphd --grid {grid} --surface hae:{} --out {name}_hae",
            place[2]
        );
        run(at, &line).succeeded();
        let record = fs::read(at.join(format!("{name}_hae/image.json"))).unwrap();
        let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
        let found: [f64; 3] =
            serde_json::from_value(record["brightest"]["position_m"].clone()).unwrap();
        let off = (DVec3::from(found) - local).abs();
        println!("{name}: {off:.3}");
        // Half a pixel, and a tenth for the oblique side lobes of the squinted response.
        assert!(off.x <= 0.18 && off.y <= 0.16 && off.z < 0.01, "{off}");
        let line = format!("export {name}_hae --format sicd -o never.nitf");
        run(at, &line).failed(1, &["above the ellipsoid", "plane"]);
    }
    fs::write(at.join("list.txt"), list).unwrap();
    python::script("points_check.py", [at.join("list.txt")]);
}

/// Tropospheric delay between a point and the satellite as path, metres: N exp(-h / 7.35 km) integrated along the line, whose height over
/// the curved Earth is its height over the plane plus the square of its horizontal distance over twice the Earth's radius.
fn extra_m(refractivity: f64, point: DVec3, satellite: DVec3) -> f64 {
    let line = satellite - point;
    let (sine, cosine2) = (
        line.z / line.length(),
        1.0 - (line.z / line.length()).powi(2),
    );
    let (count, end_m) = (100_000, 250e3);
    let step_m = end_m / f64::from(count);
    let mut sum = 0.0;
    for i in 0..count {
        let s = (f64::from(i) + 0.5) * step_m;
        let height_m = ORIGIN[2] + point.z + s * sine + s * s * cosine2 / (2.0 * 6.371e6);
        sum += (-height_m / 7350.0).exp() * step_m;
    }
    1e-6 * refractivity * sum
}

/// A recording through a vacuum from which the tropospheric delay is removed shows points nearer: shifted so that the paths to the first
/// and last position of the satellite are shorter by the delay.
#[test]
fn removed_delay_agrees_with_the_atmosphere_profile() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let point = DVec3::new(-4.0, 6.0, 0.0);
    write_recording(at, "a", scenario(point));
    let grid = "--grid x=-12:6:0.1,y=-6:14:0.05 --surface slant";
    let brightest = |name: &str| {
        let record = fs::read(at.join(name).join("image.json")).unwrap();
        let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
        let place: [f64; 3] =
            serde_json::from_value(record["brightest"]["position_m"].clone()).unwrap();
        let axis = |key: &str| -> DVec3 {
            let axis: [f64; 3] = serde_json::from_value(record["grid"][key].clone()).unwrap();
            axis.into()
        };
        (DVec3::from(place), [axis("x_axis"), axis("y_axis")])
    };
    run(at, &format!("focus a.cphd {grid} --out vacuum")).succeeded();
    let (vacuum_m, [x, y]) = brightest("vacuum");
    let satellite = |pulse: f64| {
        DVec3::new(180e3, -480e3, 350e3) + DVec3::X * (7500.0 * 12.5e-3 * (pulse - 99.5))
    };
    for (name, air, refractivity) in [
        ("mean", "exponential", 313.0),
        ("thick", "exponential:400", 400.0),
        ("none", "exponential:0", 0.0),
    ] {
        let line = format!("focus a.cphd {grid} --troposphere {air} --out {name}");
        let ran = run(at, &line);
        ran.succeeded();
        let (found_m, _) = brightest(name);
        // Two equations for the displacement along x and y.
        let [[a, b, e], [c, d, f]] = [0.0, 199.0].map(|pulse| {
            let from = satellite(pulse);
            let sight = (point - from).normalize();
            [
                sight.dot(x),
                sight.dot(y),
                -extra_m(refractivity, point, from),
            ]
        });
        let determinant = a * d - b * c;
        let expected = [(e * d - b * f) / determinant, (a * f - e * c) / determinant];
        let moved = found_m - vacuum_m;
        let measured = [moved.dot(x), moved.dot(y)];
        println!("{name}: {measured:.2?} m, {expected:.2?} expected");
        // Half a pixel of either image; along x responses are 0.35 m wide and oblique.
        assert!(
            (measured[0] - expected[0]).abs() <= 0.11,
            "{measured:?} {expected:?}"
        );
        assert!(
            (measured[1] - expected[1]).abs() <= 0.06,
            "{measured:?} {expected:?}"
        );
        assert!(refractivity == 0.0 || expected[1] < -3.0, "{expected:?}");
    }
    // Tiles of a plan are bit-identical, if the recording is given with the options it was planned with.
    let plan = format!("plan focus a.cphd {grid} --troposphere exponential -o plan.json");
    run(at, &plan).succeeded();
    run(at, "focus a.cphd --plan plan.json --out other").failed(1, &["the plan was made for"]);
    run(
        at,
        "focus a.cphd --plan plan.json --troposphere exponential --out tiles",
    )
    .succeeded();
    let [whole, tiles] =
        ["mean", "tiles"].map(|n| subaperture::io::product::read(&at.join(n)).unwrap());
    assert!(whole.image.pixels == tiles.image.pixels);
    run(at, "focus a.cphd --troposphere thick --out never").failed(2, &["exponential:313"]);
}
