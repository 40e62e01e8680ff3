//! `subap export`: SICD that NGA's sarkit accepts, reads and projects. Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use subaperture::image::ImageSource;
use subaperture::io::npy;
use subaperture::io::product;
use subaperture::monitor::Silent;
use subaperture::sicd::{Formed, Georeference, Projection, Sicd, SicdFile, SicdOptions};
use subaperture_tests::subap::{folder_with_recording, run};

/// Three points seen from 600 km by an X-band satellite squinted forward, in an Earth frame with rotated axes.
pub(crate) const SPACE: &str = r#"name = "space & time"

[scene]
reference = "0, 0, 0 m"
x = "-20, 20 m"
y = "-20, 20 m"

[[scene.point]]
position = "0, 0, 0 m"
[[scene.point]]
position = "9, -5, 0 m"
[[scene.point]]
position = "-11, 8, 0 m"

[radar]
kind = "ideal"
pulses = 160
pri = "12.5 ms"
centre = "9.6 GHz"
bandwidth = "300 MHz"
samples = 160

[platform]
kind = "linear"
position = "60, -480, 350 km"
velocity = "7500, 0, 0 m/s"
"#;

/// Line of a list for `sicd_map_check.py`: image positions out to `reach_m`, at three heights above the scene centre point, and where they are projected.
pub(crate) fn places(
    at: &Path,
    name: &str,
    xml: &str,
    reach_m: f64,
    heights_m: [f64; 3],
) -> String {
    let found = Projection::of(xml).unwrap();
    let height_m = found.scp().height_m;
    let mut places = Vec::new();
    for n in 0..25u8 {
        let along_m = [n / 5, n % 5].map(|k| 0.5 * reach_m * (f64::from(k) - 2.0));
        let height_m = height_m + heights_m[usize::from(n % 3)];
        let place = found.on_height(along_m, height_m).unwrap();
        let back = found.along_m(place.to_ecf_m()).unwrap();
        assert!(
            (0..2).all(|k| (back[k] - along_m[k]).abs() < 1e-4),
            "{name}"
        );
        places.push(serde_json::json!({
            "along_m": along_m,
            "height_m": height_m,
            "latitude_deg": place.latitude_deg,
            "longitude_deg": place.longitude_deg,
        }));
    }
    let case = serde_json::json!({ "name": name, "xml": xml, "places": places });
    let path = at.join(format!("{name}.places"));
    fs::write(&path, case.to_string()).unwrap();
    format!("places\t{}\n", path.display())
}

/// Run a script of `tests/python` that uses sarkit.
#[track_caller]
pub(crate) fn sarkit(script: &str, arguments: &[PathBuf]) {
    let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("python")
        .join(script);
    let output = Command::new(&python)
        .arg(script)
        .args(arguments)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{text}");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{text}{errors}");
}

#[test]
fn exported_sicd_is_read_and_projected_by_sarkit() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    let mut list = String::new();
    for (name, grid) in [
        (
            "fine",
            "--grid x=-20:20:0.4,y=-16:16:0.25 --window none --slow-window none",
        ),
        ("weighed", "--grid x=-20:16:0.3,y=-20:20:0.25"),
    ] {
        run(at, &format!("focus space.cphd {grid} --out {name}")).succeeded();
        run(at, &format!("export {name} --format sicd -o {name}.nitf")).succeeded();
        let [file, image] = [format!("{name}.nitf"), name.to_owned()].map(|n| at.join(n));
        list += &format!("{}\t{}\n", file.display(), image.display());
    }
    let recorded = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data/gotcha/data_3dsar_pass1_az001_HH.mat");
    match recorded.exists() {
        true => {
            run(at, &format!("focus {} --out gotcha", recorded.display())).succeeded();
            let line = "export gotcha -o gotcha.nitf --place 39.78,-84.09,240";
            run(at, line).succeeded();
            let [file, image] = ["gotcha.nitf", "gotcha"].map(|name| at.join(name));
            list += &format!("{}\t{}\n", file.display(), image.display());
        }
        false => println!("skipped: {} not found", recorded.display()),
    }
    // Segments of an image over 10 GB, at a size that can be tested. sarkit reads the samples below, and checks segments of the largest
    // size only.
    let stored = product::open(&at.join("fine")).unwrap();
    let formed = Formed::of_record(&stored.grid, &stored.metadata).unwrap();
    let options = SicdOptions {
        segment_bytes: 10_000,
        ..SicdOptions::default()
    };
    let sicd = Sicd::with_options(&formed, &Georeference::default(), 0, &options).unwrap();
    let parted = at.join("parted.nitf");
    sicd.write(&parted, &stored.pixels, &Silent).unwrap();
    let segments: usize = String::from_utf8_lossy(&fs::read(&parted).unwrap()[360..363])
        .parse()
        .unwrap();
    assert!(segments > 5, "{segments}");
    let [whole, of_parts] = [at.join("fine.nitf"), parted.clone()].map(|path| {
        let read = SicdFile::open(&path).unwrap();
        let (rows, columns) = read.size();
        read.window(&[0..rows, 0..columns]).unwrap().pixels
    });
    assert!(of_parts == whole);
    let mut others = vec![at.join("fine.nitf"), parted];
    others.extend(real());
    for (n, path) in others.iter().enumerate() {
        let read = SicdFile::open(path).unwrap();
        let (rows, columns) = read.size();
        // In two parts, so that offsets matter.
        let parts = [[0..rows / 2, 0..columns], [rows / 2..rows, 0..columns]];
        let mut all = read.window(&parts[0]).unwrap();
        all.pixels.extend(read.window(&parts[1]).unwrap().pixels);
        all.rows = rows;
        let array = at.join(format!("read{n}.npy"));
        npy::write(&array, &all).unwrap();
        list += &format!("{}\t{}\n", path.display(), array.display());
    }
    fs::write(at.join("list.txt"), list).unwrap();
    sarkit("sicd_check.py", &[at.join("list.txt")]);
    run(at, "compare fine.nitf fine.nitf").succeeded();
    // The command replaces its own file, but not a file by another program.
    run(at, "export fine --format sicd -o fine.nitf").succeeded();
    fs::write(at.join("other.nitf"), "NITF02.10 of somebody").unwrap();
    run(at, "export fine --format sicd -o other.nitf").failed(1, &["other.nitf", "--force"]);
    run(at, "export fine --format sicd -o fine/image.npy").failed(1, &["image.npy"]);
}

#[test]
fn exported_sidd_is_read_and_placed_by_sarkit() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    run(
        at,
        "focus space.cphd --grid x=-20:20:0.4,y=-16:16:0.25 --out image",
    )
    .succeeded();
    run(at, "export image --format sidd -o density.nitf").succeeded();
    run(
        at,
        "export image --format sidd --remap db --span 50 -o db.nitf",
    )
    .succeeded();
    let image = at.join("image");
    sarkit(
        "sidd_check.py",
        &[
            at.join("density.nitf"),
            image.clone(),
            at.join("db.nitf"),
            image,
        ],
    );
    // Without multilook and projection the pixels are those of the image.
    run(at, "export image --format sidd --looks 2 -o looks.nitf")
        .failed(2, &["--looks", "--format sidd"]);
    // A SICD of any origin gives a picture of its own pixels, and maps at its stated position.
    run(at, "export image --format sicd -o complex.nitf").succeeded();
    run(at, "picture complex.nitf -o again.png --top -3 --span 40").succeeded();
    assert!(at.join("again.png").exists());
    // A detected image has statistics but no point responses.
    let measured = run(at, "quality density.nitf");
    assert!(
        measured.succeeded().contains("12800 pixels"),
        "{measured:?}"
    );
    assert!(
        measured
            .stderr
            .contains("density.nitf: point responses need complex values")
    );
    run(at, "quality density.nitf --at 0,0").failed(1, &["density.nitf", "complex values"]);
}

/// Real SICDs, if present.
fn real() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/sicd");
    let paths = ["sicd_50x50.nitf", "cropped_sicd_110.nitf"].map(|name| folder.join(name));
    let (there, missing): (Vec<_>, Vec<_>) = paths.into_iter().partition(|path| path.exists());
    for path in missing {
        println!("skipped: {} not found", path.display());
    }
    there
}

/// Metadata of an image with another kind of grid in place of its plane's, as far as projection needs them: an aperture of two seconds at a
/// distance of `range_m`, `cosine` of the Doppler cone angle, and speed in m/s.
fn of_kind(xml: &str, kind: &str, [range_m, cosine, speed_m_s]: [f64; 3]) -> String {
    let line = |name: &str, coefficients: &[f64]| {
        let all: String = coefficients
            .iter()
            .enumerate()
            .map(|(k, c)| format!("<Coef exponent1=\"{k}\">{c:e}</Coef>"))
            .collect();
        format!(
            "<{name} order1=\"{}\">{all}</{name}>",
            coefficients.len() - 1
        )
    };
    let sine = (1.0 - cosine * cosine).sqrt();
    let turning = speed_m_s * sine / range_m;
    let (grid, former, block) = match kind {
        "PFA" => {
            let angle = line("PolarAngPoly", &[-turning, turning, 0.01 * turning]);
            let scale = line("SpatialFreqSFPoly", &[1.0, -0.07, 0.4]);
            ("RGAZIM", "PFA", format!("<PFA>{angle}{scale}</PFA>"))
        }
        "RGAZCOMP" => {
            let scale = sine / range_m;
            let block = format!("<RgAzComp><AzSF>{scale:e}</AzSF></RgAzComp>");
            ("RGAZIM", "RGAZCOMP", block)
        }
        _ => {
            // A scatterer seen ahead has its closest approach later; rows shift that time by the antenna's motion along them.
            let later = range_m * cosine / speed_m_s;
            let time = line("TimeCAPoly", &[1.0 + later, 1.0 / speed_m_s, 1e-14]);
            let rate = "<DRateSFPoly order1=\"1\" order2=\"1\"><Coef exponent1=\"0\" exponent2=\"0\">0.98</Coef><Coef exponent1=\"1\" exponent2=\"0\">1e-8</Coef>\
                        <Coef exponent1=\"1\" exponent2=\"1\">1e-13</Coef></DRateSFPoly>";
            let closest = format!("<R_CA_SCP>{}</R_CA_SCP>", range_m * sine);
            let block = format!("<RMA><INCA>{time}{closest}{rate}</INCA></RMA>");
            ("RGZERO", "RMA", block)
        }
    };
    xml.replace("<Type>PLANE</Type>", &format!("<Type>{grid}</Type>"))
        .replace(
            "<ImageFormAlgo>OTHER<",
            &format!("<ImageFormAlgo>{former}<"),
        )
        .replace("</SICD>", &format!("{block}</SICD>"))
}

/// Projection of every kind of grid agrees with sarkit's, and maps of SICDs agree with it: our own SICDs with the products that they were
/// made from.
#[test]
fn sicd_of_every_grid_kind_lies_where_sarkit_projects_it() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    let grid = "--grid x=-20:20:0.4,y=-16:16:0.25";
    run(at, &format!("focus space.cphd {grid} --out level")).succeeded();
    run(at, "export level -o level.nitf").succeeded();
    run(
        at,
        &format!("focus space.cphd {grid} --surface slant --out slant"),
    )
    .succeeded();
    run(at, "export slant -o slant.nitf").succeeded();
    let mut list = String::new();
    let put = |name: &str, xml: &str| places(at, name, xml, 800.0, [0.0, 15.0, 30.0]);
    let own = SicdFile::open(&at.join("slant.nitf")).unwrap();
    list += &put("plane", own.xml());
    for kind in ["PFA", "RGAZCOMP", "INCA"] {
        let geometry = [683e3, 0.15, 7500.0];
        list += &put(kind, &of_kind(own.xml(), kind, geometry));
    }
    for (n, path) in real().into_iter().enumerate() {
        let file = SicdFile::open(&path).unwrap();
        list += &put(&format!("real{n}"), file.xml());
        let map = format!("real{n}.tif");
        let line = format!("export {} -o {map} --layout amplitude", path.display());
        run(at, &line).succeeded();
        list += &format!("peak\t{}\t{}\n", at.join(map).display(), path.display());
    }
    for name in ["level", "slant"] {
        let line = format!("export {name}.nitf -o {name}.tif --layout amplitude");
        run(at, &line).succeeded();
        let [map, sicd] = ["tif", "nitf"].map(|end| at.join(format!("{name}.{end}")));
        list += &format!("peak\t{}\t{}\n", map.display(), sicd.display());
    }
    for (image, map) in [("level", "product.tif"), ("level.nitf", "sicd.tif")] {
        let line = format!("export {image} -o {map} --layout amplitude --pixel 20cm");
        run(at, &line).succeeded();
    }
    let [product, sicd] = ["product.tif", "sicd.tif"].map(|name| at.join(name));
    list += &format!("same\t{}\t{}\n", product.display(), sicd.display());
    fs::write(at.join("list.txt"), list).unwrap();
    sarkit("sicd_map_check.py", &[at.join("list.txt")]);
    let item = fs::read(at.join("sicd.json")).unwrap();
    let item: serde_json::Value = serde_json::from_slice(&item).unwrap();
    assert_eq!(item["properties"]["title"], "space & time");
    run(at, "export level.nitf -o level.kmz").succeeded();
    run(at, "export level.nitf -o level.png").succeeded();
    run(at, "export level.nitf --format sidd -o sidd.nitf").failed(2, &["level.nitf", "SICD"]);
    run(at, "export level.nitf -o a.tif --place 52,4").failed(2, &["--place", "leave"]);
    // Missing metadata are named.
    for (from, to, wanted) in [
        ("<Type>PLANE<", "<Type>PLAIN<", "'PLAIN'"),
        ("MONOSTATIC", "BISTATIC", "bistatic"),
        ("ARPPoly", "ARPPolx", "Position/ARPPoly"),
        ("<SS>", "<SS>-", "expected a positive number in Grid/Row/SS"),
    ] {
        let error = Projection::of(&own.xml().replace(from, to)).unwrap_err();
        assert!(error.to_string().contains(wanted), "{error}");
    }
}

/// The XML is the last part of a file, so a truncated file always lacks it.
#[test]
fn sicd_truncated_anywhere_is_reported_as_truncated() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    let grid = "--grid x=-2:2:0.4,y=-2:2:0.25 --window none --slow-window none";
    run(at, &format!("focus space.cphd {grid} --out small")).succeeded();
    run(at, "export small --format sicd -o whole.nitf").succeeded();
    let read = |path: &Path| SicdFile::open(path).map_err(|error| error.to_string());
    let own = at.join("whole.nitf");
    assert_eq!(read(&own).unwrap().version(), "1.3.0");
    let cut = at.join("cut.nitf");
    for path in [own].into_iter().chain(real()) {
        let whole = fs::read(&path).unwrap();
        fs::write(&cut, &whole).unwrap();
        read(&cut).unwrap();
        let file = fs::File::options().write(true).open(&cut).unwrap();
        for length in (0..whole.len()).rev() {
            file.set_len(length as u64).unwrap();
            let error = read(&cut).unwrap_err();
            assert!(
                error.contains("cut.nitf: ") && error.contains("truncated"),
                "{} at {length}: {error}",
                path.display()
            );
        }
    }
}

#[test]
fn inexpressible_images_are_refused_with_a_reason() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    run(
        at,
        "focus space.cphd --grid x=-20:20:4,y=-16:16:4 --out coarse",
    )
    .succeeded();
    let export = |image: &str, more: &str| {
        run(
            at,
            &format!("export {image} --format sicd -o out.nitf {more}"),
        )
    };
    export("coarse", "").failed(1, &["undersampled", "at most"]);
    export("coarse", "--place here").failed(2, &["52.1,4.3,43"]);
    export("missing", "").failed(1, &["missing"]);
    // A record by a version that did not record antennas.
    let path = at.join("coarse/image.json");
    let record = fs::read_to_string(&path).unwrap();
    fs::write(&path, record.replace("\"antennas\"", "\"other\"")).unwrap();
    export("coarse", "").failed(1, &["antenna times and positions", "form the image again"]);
    fs::write(&path, record.replace("\"earth\"", "\"local\"")).unwrap();
    export("coarse", "").failed(1, &["position on the Earth", "--place"]);
    assert!(!at.join("out.nitf").exists());
}

/// Several images on one grid form one Zarr group, which zarr and xarray open with the same samples. An existing group is replaced only if
/// this program wrote it, and a folder that is not a group never.
#[test]
fn stacks_are_zarr_that_xarray_opens() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    // Wider than a tile, so that tiles at the edges are padded.
    let grid = "--grid x=-10:11.2:0.04,y=-5:5:0.25 --slow-window none";
    run(at, &format!("focus space.cphd {grid} --out one")).succeeded();
    run(
        at,
        &format!("focus space.cphd {grid} --window none --tiled --out two"),
    )
    .succeeded();
    run(
        at,
        "focus space.cphd --grid x=-5:5:0.5,y=-5:5:0.5 --out other",
    )
    .succeeded();
    run(at, "export one two -o both.zarr").succeeded();
    run(at, "export one two --json -o both.zarr").succeeded();
    run(at, "export one --format zarr -o alone").succeeded();
    let [one, two, both, alone] = ["one", "two", "both.zarr", "alone"].map(|name| at.join(name));
    sarkit("zarr_check.py", &[both.clone(), one.clone(), two]);
    sarkit("zarr_check.py", &[alone, one]);
    // Measures of a pair are further arrays of the group.
    run(
        at,
        "pair one two --looks 3x5 --registered --format zarr -o pair",
    )
    .succeeded();
    sarkit("pair_check.py", &[at.join("pair/pair.zarr")]);
    // No temporary file is left.
    let hidden = fs::read_dir(at).unwrap().filter(|entry| {
        let name = entry.as_ref().unwrap().file_name();
        name.to_string_lossy().starts_with(".subap")
    });
    assert_eq!(hidden.count(), 0);

    run(at, "export one other -o grids.zarr").failed(1, &["different grids", "one", "other"]);
    assert!(!at.join("grids.zarr").exists());
    run(at, "export one two -o both.nitf").failed(2, &["--format sicd", "--format zarr"]);
    run(at, "export one --format zarr --looks 2 -o looks.zarr").failed(2, &["--looks", "zarr"]);
    // Even with --force, inputs and folders of other origin are kept.
    run(at, "export one --format zarr --force -o one").failed(1, &["one"]);
    fs::create_dir(at.join("theirs")).unwrap();
    fs::write(at.join("theirs/thesis.txt"), "all of it").unwrap();
    run(at, "export one --format zarr --force -o theirs")
        .failed(1, &["a folder of that name exists"]);
    assert!(at.join("theirs/thesis.txt").exists());
    // A group by another program is replaced with --force.
    let description = both.join("zarr.json");
    let text = fs::read_to_string(&description).unwrap();
    fs::write(&description, text.replace("subaperture-stack", "another")).unwrap();
    run(at, "export one -o both.zarr").failed(1, &["both.zarr", "--force"]);
    run(at, "export one --force -o both.zarr").succeeded();
}

/// `focus --product` writes the same bytes as `export` from the same image.
#[test]
fn focus_writes_same_products_as_export() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    let grid = "--grid x=-20:20:0.4,y=-16:16:0.25";
    let names = [
        "sicd.nitf",
        "map.tif",
        "map.json",
        "map.kmz",
        "map.png",
        "map.pgw",
        "stack.zarr",
        "image.png",
    ];
    for (name, how) in [("whole", ""), ("tiles", "--tiled")] {
        let formats = "--product sicd,cog,kmz,png,zarr";
        run(
            at,
            &format!("focus space.cphd {grid} {how} {formats} --out {name}"),
        )
        .succeeded();
        for product in names {
            assert!(at.join(name).join(product).exists(), "{name}/{product}");
        }
        for (format, product) in [("cog", "map.tif"), ("png", "map.png")] {
            run(
                at,
                &format!("export {name} --format {format} -o {name}-{product}"),
            )
            .succeeded();
            let [direct, apart] = [format!("{name}/{product}"), format!("{name}-{product}")]
                .map(|path| fs::read(at.join(path)).unwrap());
            assert!(direct == apart, "{name}/{product}");
        }
    }
    let json = run(
        at,
        &format!("focus space.cphd {grid} --product png --json --out whole"),
    );
    let printed = json.succeeded();
    assert!(printed.contains("\"files\"") && printed.contains("whole/map.png"));
    // A file at the target is reported before the computation, as is a scene without a position on the Earth.
    fs::write(at.join("tiles/map.kmz"), "somebody's").unwrap();
    run(
        at,
        &format!("focus space.cphd {grid} --product kmz --out tiles"),
    )
    .failed(1, &["map.kmz", "--force"]);
    run(
        at,
        &format!("focus space.cphd {grid} --product png,png --out twice"),
    )
    .failed(2, &["png", "twice"]);
    assert!(!at.join("twice").exists());
}
