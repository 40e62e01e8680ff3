//! Texts of the command about raw recordings: missing scene, coarse grid, samples that are not finite numbers, formats of products.

use std::fs;

use num_complex::Complex64;
use subaperture_tests::numpy;
use subaperture_tests::subap::run;

use super::*;

#[test]
fn missing_scene_is_reported_with_its_keys() {
    let folder = recorded(&samples(|_, z| z), "");
    let at = folder.path();
    let text = fs::read_to_string(at.join("rail.toml")).unwrap();
    let start = text.find("[scene]").unwrap();
    let end = text.find("[radar]").unwrap();
    fs::write(
        at.join("bare.toml"),
        format!("{}{}", &text[..start], &text[end..]),
    )
    .unwrap();
    let bare = run(at, "info bare.toml");
    bare.succeeded();
    for part in [
        "bare.toml: the description states no place of the scene",
        "x 0, y 0, z 0 m",
        "write [scene] with x and y",
        "or with reference",
    ] {
        bare.reports(part);
    }
    // A place, by the option, a setting or the text.
    for line in [
        "info bare.toml --at 0,4,0",
        "info bare.toml --set scene.reference=0,4,0m",
        "info rail.toml",
    ] {
        let ran = run(at, line);
        ran.succeeded();
        assert!(!ran.stderr.contains("no place"), "{ran:?}");
    }
}

/// The band is 8 MHz/us for 128 us less the part lost by deskew: 1.02 GHz would have a half-power width of
/// 0.886 c / (2 B) = 0.13 m without windows.
#[test]
fn coarse_grid_is_noted_with_step_and_resolution() {
    let folder = recorded(&samples(|_, z| z), "");
    let at = folder.path();
    let line = "focus rail.toml --out coarse -a bp --window none --slow-window none";
    let coarse = run(at, &format!("{line} --grid x=-1:1:0.4,y=3:5:0.4"));
    coarse.succeeded();
    coarse.reports("note: --grid is coarser than the resolution: steps of 0.4 m in x, where the half-power resolution is ");
    coarse.reports("; 0.4 m in y, where the half-power resolution is 0.15");
    let line = line.replace("coarse", "fine");
    let fine = run(at, &format!("{line} --grid x=0:0.3:0.005,y=3.9:4.1:0.05"));
    fine.succeeded();
    assert!(!fine.stderr.contains("coarser"), "{fine:?}");
}

#[test]
fn infinite_sample_is_marked_at_its_array() {
    let folder = recorded(&samples(|_, z| z), "");
    let at = folder.path();
    let mut values = samples(|_, z| z);
    values[7 * SAMPLES + 3] = Complex64::new(1.0, f64::NAN);
    write_array(at, "echoes.npy", &values, SAMPLES);
    let message = "sample 3 of pulse 7 is not a finite number";
    let ran = run(at, "focus rail.toml --out image");
    ran.failed(1, &[message, "file = \"echoes.npy\""]);
    assert!(ran.stderr.contains("rail.toml:6:8: "), "{ran:?}");
    // In an archive the array is marked.
    let array = fs::read(at.join("echoes.npy")).unwrap();
    let times = fs::read(at.join("times.npy")).unwrap();
    let archive = numpy::stored(&[("beats.npy", &array), ("t.npy", &times)]);
    fs::write(at.join("scan.npz"), archive).unwrap();
    let keys = "format = \"npz\"\nfile = \"scan.npz\"\narray = \"beats\"\ntimes = \"t\"";
    fs::write(at.join("scan.toml"), description(keys)).unwrap();
    let ran = run(at, "focus scan.toml --out image");
    ran.failed(1, &[message, "array = \"beats\"", "scan.toml:7:9: "]);
    // The pulse may be left out.
    run(at, "info scan.toml --set recording.first=8").succeeded();
}

#[test]
fn geotiff_is_written_by_its_usual_names() {
    let folder = recorded(&samples(|_, z| z), "");
    let at = folder.path();
    run(
        at,
        "focus rail.toml --out image -q --grid x=-0.4:0.6:0.008,y=3.6:4.4:0.05",
    )
    .succeeded();
    let maps: Vec<Vec<u8>> = ["cog", "tif", "tiff", "geotiff"]
        .map(|format| {
            let line = format!("export image --format {format} --place 48,11 -o {format}.tif -q");
            run(at, &line).succeeded();
            fs::read(at.join(format!("{format}.tif"))).unwrap()
        })
        .to_vec();
    assert!(maps.iter().all(|map| map.len() == maps[0].len()));
    let jpeg = run(at, "export image --format gif --place 48,11 -o map.gif");
    jpeg.failed(2, &["gif", "cog"]);
}

/// The array in Fortran order, in a file and in an archive, gives the image of C order to the bit.
#[test]
fn arrays_in_fortran_order_are_read() {
    let values = samples(|_, z| z);
    let folder = recorded(&values, "");
    let at = folder.path();
    let by_sample: Vec<Complex64> = (0..SAMPLES)
        .flat_map(|k| (0..PULSES).map(move |n| (n, k)))
        .map(|(n, k)| values[n * SAMPLES + k])
        .collect();
    let file = numpy::array(
        "<c8",
        &format!("({PULSES}, {SAMPLES})"),
        &complex64(&by_sample),
    );
    let place = file.windows(5).position(|word| word == b"False").unwrap();
    // One character fewer in the word, one space more at the end of the header.
    let header = file.len() - 8 * values.len() - 1;
    let file = [
        &file[..place],
        b"True",
        &file[place + 5..header],
        b" \n",
        &file[header + 1..],
    ]
    .concat();
    fs::write(at.join("fortran.npy"), &file).unwrap();
    let times = fs::read(at.join("times.npy")).unwrap();
    fs::write(
        at.join("scan.npz"),
        numpy::stored(&[("beats.npy", &file), ("t.npy", &times)]),
    )
    .unwrap();
    let keys = "format = \"npz\"\nfile = \"scan.npz\"\narray = \"beats\"\ntimes = \"t\"";
    fs::write(at.join("archive.toml"), description(keys)).unwrap();
    let keys = "format = \"npy\"\nfile = \"fortran.npy\"\ntimes = \"times.npy\"";
    fs::write(at.join("fortran.toml"), description(keys)).unwrap();
    let image = |name: &str| {
        run(
            at,
            &format!("focus {name}.toml --out {name} -a bp -q {GRID}"),
        )
        .succeeded();
        fs::read(at.join(name).join("image.npy")).unwrap()
    };
    let plain = image("rail");
    assert!(image("fortran") == plain && image("archive") == plain);
}
