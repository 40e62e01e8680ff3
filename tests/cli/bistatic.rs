//! Images of separated transmitters and receivers as SICD 1.4, checked, read and projected by NGA's sarkit.

use std::fs;
use std::path::Path;

use glam::DVec3;
use subaperture::image::ImageSource;
use subaperture::io::npy;
use subaperture::io::product;
use subaperture::monitor::Silent;
use subaperture::sicd::{Formed, Georeference, Projection, Sicd, SicdFile};
use subaperture_tests::dem::{degree_m, east_north_up_m, ecf_m};
use subaperture_tests::subap::{run, write_recording};

use crate::export::{places, sarkit};

/// Latitude, longitude (degrees), height above the ellipsoid (m) of the scene's origin.
const ORIGIN: [f64; 3] = [41.3, -72.9, 20.0];

/// Position and velocity of a platform with the transmitter, and offset of the receiver along, left of and above the track.
struct Geometry {
    name: &'static str,
    position: &'static str,
    velocity: &'static str,
    receiver: &'static str,
    pri: &'static str,
    grid: &'static str,
}

/// Two satellites, 17 degrees apart; two aircraft, 47 degrees apart.
const GEOMETRIES: [Geometry; 2] = [
    Geometry {
        name: "orbit",
        position: "60, -480, 350 km",
        velocity: "7500, 0, 0 m/s",
        receiver: "-150, -90, 40 km",
        pri: "12.5 ms",
        grid: "x=-12:12:0.4,y=-12:12:0.4",
    },
    Geometry {
        name: "aircraft",
        position: "0, -9, 5 km",
        velocity: "150, 20, 0 m/s",
        receiver: "7, -2, -1 km",
        pri: "10 ms",
        grid: "x=-14:14:0.45,y=-12:12:0.4",
    },
];

/// Heights of projected positions above the scene centre point, metres.
const HEIGHTS_M: [f64; 3] = [-40.0, 0.0, 40.0];

/// Recording with a reflector in metres east, north and up.
fn scenario(geometry: &Geometry, reflector: DVec3) -> String {
    format!(
        r#"name = "{}"
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
pri = "{}"
centre = "9.6 GHz"
bandwidth = "300 MHz"
samples = 3200
[[radar.receiver]]
offset = "{}"
[platform]
kind = "linear"
position = "{}"
velocity = "{}"
"#,
        geometry.name,
        ORIGIN[0],
        ORIGIN[1],
        ORIGIN[2],
        reflector.x,
        reflector.y,
        reflector.z,
        geometry.pri,
        geometry.receiver,
        geometry.position,
        geometry.velocity,
    )
}

/// Line of a list for `sicd_check.py`: a SICD and its samples as read here.
fn samples(path: &Path) -> String {
    let sicd = SicdFile::open(path).unwrap();
    let (rows, columns) = sicd.size();
    let array = path.with_extension("npy");
    npy::write(&array, &sicd.window(&[0..rows, 0..columns]).unwrap()).unwrap();
    format!("{}\t{}\n", path.display(), array.display())
}

/// Text between two marks, both included.
fn between<'a>(xml: &'a str, from: &str, to: &str) -> &'a str {
    let start = xml.find(from).unwrap();
    &xml[start..start + xml[start..].find(to).unwrap() + to.len()]
}

/// The image of polar format: angle and scale over an aperture of a few seconds.
fn polar(xml: &str) -> String {
    let line = |name: &str, [a, b]: [f64; 2]| {
        format!(
            "<{name} order1=\"1\"><Coef exponent1=\"0\">{a}</Coef><Coef exponent1=\"1\">{b}</Coef></{name}>"
        )
    };
    let block = line("PolarAngPoly", [-0.012, 0.011]) + &line("SpatialFreqSFPoly", [1.0, -0.06]);
    xml.replace("<Type>PLANE</Type>", "<Type>RGAZIM</Type>")
        .replace("<ImageFormAlgo>OTHER<", "<ImageFormAlgo>PFA<")
        .replace("</SICD>", &format!("<PFA>{block}</PFA></SICD>"))
}

/// A reference point that moves, and a centre of aperture that changes over the image.
fn general(xml: &str) -> String {
    let reference = between(xml, "<GRPPoly>", "</GRPPoly>");
    let order = between(reference, "<Y order1", ">");
    let moving = reference.replace(order, "<Y order1=\"1\"><Coef exponent1=\"1\">80</Coef>");
    let coa = between(xml, "<TimeCOAPoly", "</TimeCOAPoly>");
    let slope = "<Coef exponent1=\"1\" exponent2=\"0\">2e-4</Coef></TimeCOAPoly>";
    let changing = coa
        .replace("order1=\"0\"", "order1=\"1\"")
        .replace("</TimeCOAPoly>", slope);
    xml.replace(reference, &moving).replace(coa, &changing)
}

/// Two receivers, each `apart_m` from the image's, on opposite sides.
fn two_receivers(xml: &str, apart_m: f64) -> String {
    let receiver = between(xml, "<RcvAPCPoly index=\"1\">", "</RcvAPCPoly>");
    let constant = between(receiver, "<Coef exponent1=\"0\">", "</Coef>");
    let number = constant.trim_start_matches("<Coef exponent1=\"0\">");
    let number: f64 = number.trim_end_matches("</Coef>").parse().unwrap();
    let moved = |by_m: f64| {
        let coefficient = format!("<Coef exponent1=\"0\">{:?}</Coef>", number + by_m);
        receiver.replacen(constant, &coefficient, 1)
    };
    let second = moved(-apart_m).replace("index=\"1\">", "index=\"2\">");
    let both = moved(apart_m) + &second;
    let channel = between(xml, "<ChanParameters index=\"1\">", "</ChanParameters>");
    let other = channel
        .replace("index=\"1\"", "index=\"2\"")
        .replace("<RcvAPCIndex>1<", "<RcvAPCIndex>2<");
    xml.replace(receiver, &both)
        .replace(channel, &format!("{channel}{other}"))
        .replace("<ChanIndex>1<", "<ChanIndex>1</ChanIndex><ChanIndex>2<")
}

#[test]
fn bistatic_sicd_passes_checks_and_places_reflectors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let [north, east] = degree_m(ORIGIN[0]);
    let (mut files, mut points, mut maps) = (String::new(), String::new(), String::new());
    for (geometry, [y, x, z]) in GEOMETRIES.iter().flat_map(|geometry| {
        [
            (geometry, [6.0, -4.0, 0.0]),
            (geometry, [310.0, 420.0, 25.0]),
        ]
    }) {
        let name = format!("{}{}", geometry.name, z);
        let place = [ORIGIN[0] + y / north, ORIGIN[1] + x / east, ORIGIN[2] + z];
        let (point, local) = (ecf_m(place), east_north_up_m(ORIGIN, place));
        let text = scenario(geometry, local);
        write_recording(at, &name, &text);
        let (x, y, z) = (local.x.round(), local.y.round(), local.z - 2.0);
        for (image, more) in [("level", ""), ("slant", "--surface slant")] {
            let own = format!("{name}_{image}");
            let grid = format!("{},cx={x},cy={y},z={z}", geometry.grid);
            run(
                at,
                &format!("focus {name}.cphd --grid {grid} {more} --out {own}"),
            )
            .succeeded();
            run(at, &format!("export {own} --format sicd -o {own}.nitf")).succeeded();
            let [path, product] = [format!("{own}.nitf"), own.clone()].map(|file| at.join(file));
            let sicd = SicdFile::open(&path).unwrap();
            assert_eq!(sicd.version(), "1.4.0");
            files += &format!("{}\t{}\n", path.display(), product.display());
            let newest = format!("{own}_1.5.nitf");
            run(at, &format!("export {own} --sicd-version 1.5 -o {newest}")).succeeded();
            assert_eq!(SicdFile::open(&at.join(&newest)).unwrap().version(), "1.5");
            files += &format!("{}\t{}\n", at.join(newest).display(), product.display());
            let [px, py, pz] = point.to_array();
            points += &format!("{}\t{px}\t{py}\t{pz}\t{}\n", path.display(), place[2]);
            maps += &places(at, &own, sicd.xml(), 12.0, HEIGHTS_M);
            maps += &places(at, &format!("{own}_far"), sicd.xml(), 800.0, HEIGHTS_M);
            maps += &places(
                at,
                &format!("{own}_polar"),
                &polar(sicd.xml()),
                800.0,
                HEIGHTS_M,
            );
            maps += &places(
                at,
                &format!("{own}_general"),
                &general(sicd.xml()),
                800.0,
                HEIGHTS_M,
            );
            files += &samples(&path);
        }
    }
    for geometry in &GEOMETRIES {
        let name = format!("{}0_level", geometry.name);
        for (image, map) in [
            (format!("{name}.nitf"), "tif"),
            (name.clone(), "product.tif"),
        ] {
            let line = format!("export {image} -o {name}.{map} --layout amplitude --pixel 30cm");
            run(at, &line).succeeded();
        }
        run(at, &format!("export {name}.nitf -o {name}.kmz")).succeeded();
        let [map, product, sicd] =
            ["tif", "product.tif", "nitf"].map(|end| at.join(format!("{name}.{end}")));
        maps += &format!("peak\t{}\t{}\n", map.display(), sicd.display());
        maps += &format!("same\t{}\t{}\n", product.display(), map.display());
        let text = run(at, &format!("info {name}.nitf")).succeeded().to_owned();
        assert!(text.contains("SICD 1.4.0"), "{text}");
        let text = run(at, &format!("quality {name}.nitf"));
        assert!(text.succeeded().contains("3 dB width"), "{text:?}");
        let line = format!("export {name} --sicd-version 1.3 -o never.nitf");
        run(at, &line).failed(1, &["expected SICD 1.4.0 or later", "bistatic"]);
        let line = format!("export {name} --sicd-version 1.5 -o never.tif");
        run(at, &line).failed(2, &["--format sicd"]);
        let line = format!("export {name} --format sidd -o never.nitf");
        run(at, &line).failed(1, &["milliradian", "SIDD describes monostatic images"]);
    }
    // Files of other versions and pixel types by sarkit.
    let others = at.join("others");
    fs::create_dir(&others).unwrap();
    let source = at.join("aircraft25_level.nitf");
    sarkit("sicd_write.py", &[source.clone(), others.clone()]);
    for (name, version) in [
        ("1.4.0-RE16I_IM16I", "1.4.0"),
        ("1.5-RE32F_IM32F", "1.5"),
        ("1.5-RE16I_IM16I", "1.5"),
        ("1.5-AMP8I_PHS8I", "1.5"),
    ] {
        let path = others.join(format!("{name}.nitf"));
        let sicd = SicdFile::open(&path).unwrap();
        assert_eq!(sicd.version(), version);
        files += &format!("{}\t-\n", path.display());
        files += &samples(&path);
        let [one, two] = [&source, &path].map(|path| {
            let projection = SicdFile::open(path).unwrap().projection().unwrap();
            let place = projection.on_height([3.0, -2.0], 40.0).unwrap();
            place.to_ecf_m()
        });
        assert_eq!(one, two);
    }
    // Platforms with their own velocities, and one at rest.
    let stored = product::open(&at.join("aircraft0_level")).unwrap();
    let formed = Formed::of_record(&stored.grid, &stored.metadata).unwrap();
    let last = (formed.antennas.receivers_m.len() - 1) as f64;
    for (name, speed) in [
        ("crossing", [-0.004, 0.3, 0.01]),
        ("opposed", [-1.6, 0.0, 0.0]),
    ] {
        let mut other = formed.clone();
        for (n, receiver) in other.antennas.receivers_m.iter_mut().enumerate() {
            *receiver += DVec3::from(speed) * (n as f64 - 0.5 * last) * 300.0 / last;
        }
        let sicd = Sicd::new(&other, &Georeference::default(), 0).unwrap();
        let path = at.join(format!("{name}.nitf"));
        sicd.write(&path, &stored.pixels, &Silent).unwrap();
        files += &format!("{}\t-\n", path.display());
        maps += &places(at, name, sicd.xml(), 500.0, HEIGHTS_M);
    }
    let mut fixed = formed.clone();
    let middle = fixed.antennas.receivers_m[fixed.antennas.receivers_m.len() / 2];
    fixed.antennas.receivers_m.fill(middle);
    let sicd = Sicd::new(&fixed, &Georeference::default(), 0).unwrap();
    let receiver = between(sicd.xml(), "<RcvPlatform>", "</RcvPlatform>");
    assert!(receiver.contains("<DopplerConeAng>90"));
    maps += &places(at, "fixed", sicd.xml(), 500.0, HEIGHTS_M);
    for (list, lines, script) in [
        ("files.txt", files, "sicd_check.py"),
        ("points.txt", points, "points_check.py"),
        ("maps.txt", maps, "sicd_map_check.py"),
    ] {
        fs::write(at.join(list), lines).unwrap();
        sarkit(script, &[at.join(list)]);
    }
    assert_mean_of_receivers(sicd.xml());
    refusals(&formed, sicd.xml());
}

/// Receivers on opposite sides of the image's own have the same mean.
#[track_caller]
fn assert_mean_of_receivers(xml: &str) {
    let [one, two] = [xml, &two_receivers(xml, 40.0)].map(|xml| Projection::of(xml).unwrap());
    let of = |found: &Projection| found.on_height([30.0, -50.0], 25.0).unwrap().to_ecf_m();
    assert!(of(&one).distance(of(&two)) < 1e-6);
}

/// Apertures that SICD cannot describe, and metadata that do not define a projection, are refused with the reason.
fn refusals(formed: &Formed, xml: &str) {
    let refused = |change: &dyn Fn(&mut Formed)| {
        let mut other = formed.clone();
        change(&mut other);
        let error = Sicd::new(&other, &Georeference::default(), 0).unwrap_err();
        error.to_string()
    };
    let error = refused(&|formed| formed.antennas.timed = false);
    assert!(error.contains("no pulse times"), "{error}");
    let error = refused(&|formed| {
        // Behind the scene, mirrored about its centre.
        let pairs = formed.antennas.receivers_m.iter_mut();
        for (receiver, transmitter) in pairs.zip(&formed.antennas.transmitters_m) {
            *receiver = -*transmitter;
        }
    });
    assert!(error.contains("opposite directions"), "{error}");
    let error = refused(&|formed| {
        let [t, r] = [
            formed.antennas.transmitters_m[0],
            formed.antennas.receivers_m[0],
        ];
        formed.antennas.transmitters_m.fill(t);
        formed.antennas.receivers_m.fill(r);
    });
    assert!(error.contains("does not turn"), "{error}");
    for (from, to, wanted) in [
        (
            "urn:SICD:1.4.0",
            "urn:SICD:1.3.0",
            "from SICD 1.4, found version 1.3.0",
        ),
        ("TxAPCPoly", "TxAPCPolx", "Position/TxAPCPoly"),
        ("GRPPoly", "GRPPolx", "Position/GRPPoly"),
        (
            "<RcvAPCIndex>1<",
            "<RcvAPCIndex>2<",
            "RcvAPCPoly of index 2",
        ),
        (
            "<ChanIndex>1<",
            "<ChanIndex>3<",
            "ChanParameters of index 3",
        ),
        (
            "<Type>PLANE<",
            "<Type>RGZERO<",
            "of a bistatic image, found 'RGZERO'",
        ),
    ] {
        let mut xml = xml.replace(from, to);
        if to.contains("RGZERO") {
            let line = "<TimeCAPoly order1=\"0\"><Coef exponent1=\"0\">1</Coef></TimeCAPoly>";
            let rate = line.replace("TimeCAPoly", "DRateSFPoly");
            let block = format!("<RMA><INCA>{line}<R_CA_SCP>9000</R_CA_SCP>{rate}</INCA></RMA>");
            xml = xml.replace("</SICD>", &format!("{block}</SICD>"));
        }
        let error = Projection::of(&xml).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    }
}
