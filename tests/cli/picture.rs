//! `subap picture`: multilook, colour by sub-aperture and by polarisation, and refusals.

use std::fs;
use std::path::Path;

use subaperture_tests::subap::run;

/// Writes a complex64 array of 8 rows and 8 columns.
fn array(path: &Path, value: impl Fn(usize, usize) -> f32) {
    let header = "{'descr': '<c8', 'fortran_order': False, 'shape': (8, 8), }";
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").bytes());
    for i in 0..64 {
        bytes.extend(value(i / 8, i % 8).to_le_bytes());
        bytes.extend(0f32.to_le_bytes());
    }
    fs::write(path, bytes).unwrap();
}

/// Number of pixels of each colour in a picture.
fn colours(path: &Path) -> std::collections::HashMap<[u8; 3], usize> {
    let mut reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap()))
        .read_info()
        .unwrap();
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut data).unwrap();
    let grey = info.color_type == png::ColorType::Grayscale;
    let bytes = data[..info.buffer_size()].to_vec();
    let data: Vec<u8> = match grey {
        true => bytes.into_iter().flat_map(|level| [level; 3]).collect(),
        false => bytes,
    };
    let mut counts = std::collections::HashMap::new();
    for pixel in data.chunks_exact(3) {
        *counts.entry([pixel[0], pixel[1], pixel[2]]).or_insert(0) += 1;
    }
    counts
}

/// Three images, each with one bright quadrant, and the fourth bright in all of them: red, green, blue and white, each on an exact quarter
/// of the drawn 8 x 8 pixels.
#[test]
fn three_images_become_red_green_and_blue() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let quadrant = |row: usize, column: usize| 2 * (row / 4) + column / 4;
    for (i, name) in ["hh.npy", "hv.npy", "vv.npy"].iter().enumerate() {
        let lit = |row, column| [i, 3].contains(&quadrant(row, column));
        array(&at.join(name), |row, column| {
            f32::from(u8::from(lit(row, column)))
        });
    }
    run(
        at,
        "picture hh.npy hv.npy vv.npy -o rgb.png --top 0 --span 40",
    )
    .succeeded();
    let seen = colours(&at.join("rgb.png"));
    let count = |colour: [u8; 3]| seen.get(&colour).copied().unwrap_or(0);
    let red = count([255, 0, 0]);
    assert!(red > 10_000, "{red}");
    // The key has the same number of pixels of each colour.
    assert_eq!(count([0, 255, 0]), red);
    assert_eq!(count([0, 0, 255]), red);
    // In the Pauli basis a trihedral, equal in HH and VV, is pure blue.
    array(&at.join("one.npy"), |_, _| 1.0);
    array(&at.join("none.npy"), |_, _| 0.0);
    run(
        at,
        "picture one.npy none.npy none.npy one.npy -o pauli.png --top 3 --span 40",
    )
    .succeeded();
    let seen = colours(&at.join("pauli.png"));
    // An amplitude of 2 / sqrt 2 is 3.01 dB: the maximum, in all four quadrants; the key, drawn once, has some of the pixels of `red`.
    let blue = seen.get(&[0, 0, 255]).copied().unwrap_or(0);
    assert!(blue > 39 * red / 10 && blue < 4 * red, "{blue} {red}");
}

/// Multilook of 2 x 2 on a checkerboard of powers 1 and 0 is 1/2 everywhere: one grey, 3 dB below white of 30.
#[test]
fn multilook_averages_power() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    array(&at.join("a.npy"), |row, column| {
        f32::from(u8::from((row + column) % 2 == 0))
    });
    let ran = run(
        at,
        "picture a.npy -o looks.png --looks 2x2 --top 0 --span 30.1029995664 --json",
    );
    ran.succeeded();
    let seen = colours(&at.join("looks.png"));
    let grey = (255.0f64 * 0.9).round() as u8;
    let half = seen.get(&[grey; 3]).copied().unwrap_or(0);
    assert!(half > 300_000, "{half}");
}

/// Sub-apertures of a simulated scene, and inputs that cannot be coloured.
#[test]
fn product_is_coloured_by_sub_aperture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o table.cphd").succeeded();
    run(
        at,
        "focus table.cphd --grid x=-6:6:0.1,y=-5:5:0.1 --out image",
    )
    .succeeded();
    run(at, "picture image -o parts.png --sub-apertures 3").succeeded();
    let seen = colours(&at.join("parts.png"));
    let coloured = seen
        .iter()
        .filter(|([r, g, b], _)| r.abs_diff(*g).max(g.abs_diff(*b)) > 60);
    assert!(coloured.map(|(_, count)| count).sum::<usize>() > 1000);
    array(&at.join("a.npy"), |_, _| 1.0);
    for (line, code, parts) in [
        (
            "picture a.npy -o b.png --sub-apertures 3",
            1,
            &["a.npy", "sub-apertures need the record"][..],
        ),
        (
            "picture image -o b.png --sub-apertures 1",
            2,
            &["--sub-apertures"],
        ),
        ("picture image -o b.png --looks 0", 2, &["--looks"]),
        (
            "picture image -o b.png --looks 500",
            1,
            &["500 x 500 looks"],
        ),
        (
            "picture image a.npy -o b.png",
            1,
            &["100 rows x 120 columns"],
        ),
        (
            "picture a.npy a.npy -o b.png --colours viridis",
            1,
            &["several images"],
        ),
    ] {
        run(at, line).failed(code, parts);
    }
    assert!(!at.join("b.png").exists());
}
