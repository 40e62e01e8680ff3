//! Reading GOTCHA files: the real ones against values from a hex dump, and every invalid one.

use std::path::{Path, PathBuf};

use num_complex::Complex32;
use subaperture::io::gotcha;
use subaperture::io::open::{self, Options};
use subaperture::phase_history::{InMemory, PhaseHistory, ReadError};
use subaperture_tests::matlab::{self, Value};

/// A real file; `None` with a message if it is missing.
fn real_file(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data/gotcha")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} not found", path.display());
    None
}

fn read_bytes(bytes: &[u8]) -> Result<InMemory, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample.mat");
    std::fs::write(&path, bytes).unwrap();
    gotcha::read(&path, u64::MAX)
}

fn message(bytes: &[u8]) -> String {
    match read_bytes(bytes) {
        Ok(_) => panic!("read without an error"),
        Err(error) => error.to_string(),
    }
}

/// The fields with one of them replaced or removed.
fn with(name: &'static str, value: Option<Value>) -> Vec<u8> {
    let mut fields = matlab::gotcha_fields();
    let at = fields.iter().position(|f| f.0 == name).unwrap();
    match value {
        Some(value) => fields[at].1 = value,
        None => drop(fields.remove(at)),
    }
    matlab::gotcha(fields)
}

#[test]
fn real_files_have_the_published_band_and_geometry() {
    let names = [1, 2].map(|i| format!("data_3dsar_pass1_az00{i}_HH.mat"));
    let Some(paths): Option<Vec<PathBuf>> = names.iter().map(|n| real_file(n)).collect() else {
        return;
    };
    let aperture = open::open_all(&paths, &Options::default()).unwrap();
    let collection = aperture.collection();
    assert_eq!(collection.num_samples, 424);
    assert_eq!(collection.pulses.len(), 2 * 117);
    let band = collection.band().unwrap();
    // 9.28808 GHz and 1.471 MHz are published with these digits; the tolerance is half of the last one.
    assert!((band.start_hz - 9.28808e9).abs() < 5e3, "{band:?}");
    assert!((band.step_hz - 1.471e6).abs() < 5e2, "{band:?}");
    // r0 of both files equals the length of the position up to its rounding, so the position is the reference.
    for pulse in &collection.pulses {
        let position_m = pulse.transmitter_m;
        assert_eq!(pulse.reference_path_m, 2.0 * position_m.length());
    }
    // First and last values of each file, from a hex dump: fp begins at byte 0x128 with its 49608 real parts, tag included, and the
    // imaginary parts follow 8 bytes after the last.
    for (i, path) in paths.iter().enumerate() {
        let bytes = std::fs::read(path).unwrap();
        let at = |offset: usize| f32::from_le_bytes(bytes[offset..offset + 4].try_into().unwrap());
        let (re, im) = (0x128, 0x128 + 424 * 117 * 4 + 8);
        let mut pulse = vec![Complex32::default(); 2 * 424];
        aperture.read(i * 117 + 3..i * 117 + 5, &mut pulse).unwrap();
        for k in [0, 1, 423, 424, 847] {
            let offset = (3 * 424 + k) * 4;
            assert_eq!(pulse[k], Complex32::new(at(re + offset), at(im + offset)));
        }
    }
    let inputs = aperture.inputs().unwrap();
    assert_eq!(inputs.len(), 2);
    assert_eq!(inputs[0].bytes, 403_232);
    assert_eq!(inputs[0].path, paths[0]);
}

#[test]
fn values_shapes_and_signs_of_a_synthetic_file() {
    for packed in [false, true] {
        let data = matlab::matrix("data", &Value::Structure(1, 1, matlab::gotcha_fields()));
        let other = matlab::matrix("note", &Value::Text("first"));
        let bytes = match packed {
            false => matlab::file(&[other, data]),
            true => matlab::file(&[matlab::compressed(&other), matlab::compressed(&data)]),
        };
        let recorded = read_bytes(&bytes).unwrap();
        let collection = recorded.collection();
        assert_eq!((collection.num_samples, collection.pulses.len()), (4, 3));
        assert_eq!(collection.name, "sample");
        let mut samples = vec![Complex32::default(); 12];
        recorded.read(0..3, &mut samples).unwrap();
        for n in 0..3 {
            for k in 0..4 {
                let i = (k + 10 * n) as f32;
                assert_eq!(samples[n * 4 + k], Complex32::new(i, -i - 0.5));
            }
        }
        let pulse = collection.pulses[2];
        assert_eq!(pulse.transmitter_m.to_array(), [7002.0, 3.0, 7200.5]);
        assert_eq!(pulse.receiver_m, pulse.transmitter_m);
        assert_eq!(pulse.reference_m.to_array(), [0.0; 3]);
        assert_eq!(pulse.reference_path_m, 2.0 * 10_044.0);
        assert_eq!(pulse.time_s, 2.0);
        // The frequencies lie exactly on the line; float64 sums round in the 16th digit.
        assert!((pulse.start_hz - 9.3e9).abs() < 1e-4);
        assert!((pulse.step_hz - 1.5e6).abs() < 1e-4);
    }
}

/// RMS and largest phase error of a point, radians, from a file of one degree whose numbers are stored as float32, with the reader's
/// reference path. The stored range `r0` is too long by `more_m(n)`.
fn phase_left_rad(more_m: impl Fn(usize) -> f64) -> [f64; 2] {
    const PULSES: usize = 117;
    const LIGHT_M_S: f64 = 299_792_458.0;
    let point = [-15.6, 21.6, 0.0];
    let range_m = |at: [f64; 3], to: [f64; 3]| {
        let squares = (0..3).map(|i| (at[i] - to[i]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let antenna = |n: usize| {
        let angle = (n as f64 / PULSES as f64).to_radians();
        [7089.3 * angle.cos(), 7089.3 * angle.sin(), 7275.6]
    };
    let rows = |value: &dyn Fn(usize) -> f64| {
        let single = (0..PULSES).map(|n| value(n) as f32);
        Value::Single(1, PULSES as i32, single.collect())
    };
    let mut fields = matlab::gotcha_fields();
    let samples = vec![1.0; 4 * PULSES];
    fields[0].1 = Value::Complex(4, PULSES as i32, samples.clone(), samples);
    for (name, value) in &mut fields {
        match *name {
            "x" => *value = rows(&|n| antenna(n)[0]),
            "y" => *value = rows(&|n| antenna(n)[1]),
            "z" => *value = rows(&|n| antenna(n)[2]),
            "r0" => *value = rows(&|n| range_m(antenna(n), [0.0; 3]) + more_m(n)),
            _ => {}
        }
    }
    let recorded = read_bytes(&matlab::gotcha(fields)).unwrap();
    let (mut square, mut most) = (0.0, 0.0f64);
    for (n, pulse) in recorded.collection().pulses.iter().enumerate() {
        let true_m = range_m(antenna(n), point) - range_m(antenna(n), [0.0; 3]) - more_m(n);
        let got_m = range_m(pulse.transmitter_m.to_array(), point) - pulse.reference_path_m / 2.0;
        let phase_rad = 4.0 * std::f64::consts::PI * 9.6e9 / LIGHT_M_S * (got_m - true_m);
        square += phase_rad * phase_rad / PULSES as f64;
        most = most.max(phase_rad.abs());
    }
    [square.sqrt(), most]
}

#[test]
fn rounded_range_is_replaced_by_that_of_position() {
    // x and z are stored to 0.24 mm at worst, y and r0 to 0.004 and 0.49 mm. Seen from 10158 m at 26.6 m from the centre the line of sight
    // differs by 2.6e-3: 0.34 mm of position are 0.9 um of range, at 402 rad/m 3.6e-4 rad.
    let [_, most] = phase_left_rad(|_| 0.0);
    assert!(most < 3.6e-4, "{most}");
    // A range that differs from that of the position is kept with its rounding: a step of 0.98 mm is 0.28 mm RMS, with those of x and z
    // (0.14 mm each, at 45 degrees) 0.31 mm or 0.13 rad, to a quarter for 117 pulses.
    let [rms, _] = phase_left_rad(|n| 0.01 * n as f64);
    assert!((rms / 0.13 - 1.0).abs() < 0.25, "{rms}");
}

#[test]
fn checksum_is_ieee_crc32() {
    // "123456789" has CRC-32 cbf43926 by the standard; that of a file is computed bit by bit here.
    let bytes = matlab::gotcha(matlab::gotcha_fields());
    let mut crc = !0u32;
    for &byte in &bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg());
        }
    }
    let inputs = read_bytes(&bytes).unwrap().inputs().unwrap();
    assert_eq!(inputs[0].identity.text(), format!("{:08x}", !crc));
    assert_eq!(inputs[0].bytes, bytes.len() as u64);
}

#[test]
fn missing_and_misshapen_fields_are_named() {
    for name in ["fp", "freq", "x", "y", "z", "r0"] {
        let text = message(&with(name, None));
        assert!(text.contains(&format!("data.{name} is missing")), "{text}");
        assert!(text.contains("fields found:"), "{text}");
        let text = message(&with(name, Some(Value::Empty)));
        assert!(
            text.contains(&format!("data.{name}: expected")) && text.contains("found 0 x 0"),
            "{text}"
        );
        let text = message(&with(name, Some(Value::Text("none"))));
        assert!(
            text.contains(&format!("data.{name}: expected")) && text.contains("found 1 x 4 text"),
            "{text}"
        );
    }
    let two = Value::Double(1, 2, vec![1.0, 2.0]);
    for (name, value, part) in [
        ("x", two.clone(), "since data.fp has 3 columns, found 1 x 2"),
        ("freq", two, "since data.fp has 4 rows, found 1 x 2"),
        (
            "fp",
            Value::Single(4, 3, vec![0.0; 12]),
            "data.fp: expected a complex matrix, frequencies x pulses, found 4 x 3 single",
        ),
        (
            "fp",
            Value::Complex(4, 0, vec![], vec![]),
            "data.fp is 4 x 0: no image can be formed from 0 pulses",
        ),
        (
            "fp",
            Value::Complex(1, 3, vec![0.0; 3], vec![0.0; 3]),
            "no image can be formed from 3 pulses of 1 frequencies",
        ),
        (
            "fp",
            Value::Complex(4, 3, vec![0.0; 11], vec![0.0; 12]),
            "its real part has 11",
        ),
        (
            "fp",
            Value::Complex(i32::MAX, i32::MAX, vec![0.0; 12], vec![0.0; 12]),
            "its real part has 12",
        ),
        (
            "fp",
            Value::Complex(-4, -3, vec![0.0; 12], vec![0.0; 12]),
            "dimension -4 is negative",
        ),
        (
            "z",
            Value::Double(1, 3, vec![1.0, f64::NAN, 1.0]),
            "data.z: expected finite values, found NaN at index 1",
        ),
        (
            "r0",
            Value::Double(1, 3, vec![1.0, 1.0, -1.0]),
            "data.r0 of pulse 2: expected a positive range in metres, found -1",
        ),
        (
            "freq",
            Value::Double(4, 1, vec![9.3e9, 9.2e9, 9.1e9, 9.0e9]),
            "positive, ascending",
        ),
        (
            "freq",
            Value::Double(4, 1, vec![9.3e9; 4]),
            "positive, ascending",
        ),
        (
            // A bend of d in the last of four leaves residuals of 0.4 d at sample 2 and 0.3 d at sample 3.
            "freq",
            Value::Double(4, 1, vec![1e9, 2e9, 3e9, 4e9 + 12_000.0]),
            "4800 Hz off the straight line",
        ),
    ] {
        let text = message(&with(name, Some(value)));
        assert!(text.contains(part), "{name}: {text}");
    }
    let mut im = vec![0.0; 12];
    im[6] = f32::INFINITY;
    match read_bytes(&with("fp", Some(Value::Complex(4, 3, vec![0.0; 12], im)))) {
        Err(ReadError::NotFinite { pulse, sample, .. }) => assert_eq!((pulse, sample), (1, 2)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn float32_frequencies_are_fitted_by_a_line() {
    // Float32 represents multiples of 1024 Hz here, so a frequency is off by up to 512 Hz. Over K = 424 frequencies the step of the line
    // has a standard deviation of 1024 / sqrt(12) / sqrt(K^3 / 12) = 0.12 Hz and its start of 2 * 1024 / sqrt(12 K) = 29 Hz; five of each
    // are allowed.
    let freq: Vec<f32> = (0..424)
        .map(|k| (9.288_080_384e9 + 1_471_301.6 * f64::from(k)) as f32)
        .collect();
    let mut fields = matlab::gotcha_fields();
    fields[0].1 = Value::Complex(424, 3, vec![1.0; 1272], vec![0.0; 1272]);
    fields[1].1 = Value::Single(424, 1, freq);
    let recorded = read_bytes(&matlab::gotcha(fields)).unwrap();
    let band = recorded.collection().band().unwrap();
    assert!((band.start_hz - 9.288_080_384e9).abs() < 145.0, "{band:?}");
    assert!((band.step_hz - 1_471_301.6).abs() < 0.6, "{band:?}");
}

#[test]
fn frequencies_in_other_units_or_unordered_are_refused() {
    let band = |k: i32| 9.288_080_384e9 + 1_471_301.6 * f64::from(k);
    // Marsaglia's xorshift, from 0 to 1.
    let mut state = 1u32;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        f64::from(state) / f64::from(u32::MAX)
    };
    let refused = |freq: Vec<f64>, part: &str| {
        let count = freq.len();
        let mut fields = matlab::gotcha_fields();
        let fp = Value::Complex(count as i32, 3, vec![1.0; 3 * count], vec![0.0; 3 * count]);
        fields[0].1 = fp;
        fields[1].1 = Value::Double(count as i32, 1, freq);
        let text = message(&matlab::gotcha(fields));
        assert!(text.contains(part), "{text}");
    };
    let all = || (0..424).map(band);
    refused(all().map(|f| f / 1e9).collect(), "expected hertz");
    refused(all().map(|f| f / 1e6).collect(), "expected hertz");
    // In kHz the band is 9.3 MHz; a deviation of 4 kHz then exceeds the float32 step of 1 Hz.
    refused(
        all().map(|f| f / 1e3 + 40.0 * random()).collect(),
        "equal spacing within 4 Hz",
    );
    // Float32 steps of 1024 Hz exceed the line's own step here: a quarter of it is the limit.
    refused(
        (0..424)
            .map(|k| 9.3e9 + 1000.0 * (f64::from(k) + random()))
            .collect(),
        "expected equal spacing within 250 Hz",
    );
    let mut sorted: Vec<f64> = (0..424).map(|_| 9.3e9 + 6e8 * random()).collect();
    sorted.sort_by(f64::total_cmp);
    refused(sorted, "equal spacing within 4096 Hz");
    let unsorted: Vec<f64> = (0..424).map(|_| 9.3e9 + 6e8 * random()).collect();
    refused(unsorted, "data.freq");
}

#[test]
fn other_mat_files_are_refused_with_their_kind() {
    let note = matlab::matrix("note", &Value::Text("hello"));
    let image = matlab::matrix("image", &Value::Single(2, 3, vec![0.0; 6]));
    let text = message(&matlab::file(&[note, matlab::compressed(&image)]));
    for part in [
        "sample.mat",
        "'note' (1 x 5 text)",
        "'image' (2 x 3 single)",
        "fp, freq",
    ] {
        assert!(text.contains(part), "{text}");
    }
    assert!(message(&matlab::file(&[])).contains("variables found: none"));
    assert!(message(b"").contains("the file is empty"));
    let plain = matlab::matrix("data", &Value::Double(1, 1, vec![1.0]));
    assert!(message(&matlab::file(&[plain])).contains("found 1 x 1 double"));
    let many = matlab::matrix("data", &Value::Structure(1, 2, vec![]));
    assert!(message(&matlab::file(&[many])).contains("found 1 x 2 structure"));
    let mut swapped = matlab::gotcha(matlab::gotcha_fields());
    swapped[126..128].copy_from_slice(b"MI");
    assert!(message(&swapped).contains("big-endian"));
}

#[test]
fn file_kind_follows_from_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("misnamed.cphd");
    std::fs::write(&path, matlab::gotcha(matlab::gotcha_fields())).unwrap();
    assert_eq!(
        open::open(&path, &Options::default())
            .unwrap()
            .collection()
            .pulses
            .len(),
        3
    );
    let error = open::open(
        &path,
        &Options {
            channel: Some("HH"),
            ..Options::default()
        },
    )
    .err()
    .unwrap()
    .to_string();
    assert!(error.contains("no channels"), "{error}");
    for (start, part) in [
        (&b""[..], "empty"),
        (
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64",
            "save it again with -v7",
        ),
        (b"\x93NUMPY\x01\x00", "NumPy array"),
        (b"\x89HDF\r\n", "HDF5"),
        (b"NITF02.10", "NITF"),
        (b"CPHD/0.3\n", "before version 1"),
        (b"hello", "neither CPHD nor MATLAB 5"),
    ] {
        std::fs::write(&path, start).unwrap();
        let error = open::open(&path, &Options::default())
            .err()
            .unwrap()
            .to_string();
        for part in [part, "misnamed.cphd", "CPHD 1.x, CRSD 1.0, GOTCHA"] {
            assert!(error.contains(part), "{error}");
        }
    }
    let absent = folder.path().join("absent.mat");
    let error = open::open(&absent, &Options::default())
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("absent.mat"), "{error}");
    assert!(open::open(folder.path(), &Options::default()).is_err());
    assert!(gotcha::read(folder.path(), u64::MAX).is_err());
    assert!(open::open_all::<PathBuf>(&[], &Options::default()).is_err());
}

#[test]
fn decompression_bomb_is_refused() {
    // 64 MiB of zeros compress to 64 KiB.
    let zeros = Value::Double(1, 8 << 20, vec![0.0; 8 << 20]);
    let bytes = matlab::file(&[matlab::compressed(&matlab::matrix("data", &zeros))]);
    let text = message(&bytes);
    assert!(text.contains("more than 32 times is refused"), "{text}");
}

#[test]
fn damaged_compressed_data_is_detected() {
    let data = matlab::matrix("data", &Value::Structure(1, 1, matlab::gotcha_fields()));
    let good = matlab::file(&[matlab::compressed(&data)]);
    let samples_of = |bytes: &[u8]| {
        let mut samples = vec![Complex32::default(); 12];
        read_bytes(bytes)?.read(0..3, &mut samples)?;
        Ok::<_, ReadError>(samples)
    };
    let right = samples_of(&good).unwrap();
    // A flipped bit in zlib's stream invalidates its header or code, changes the data and so the Adler-32 in the last four bytes, or is
    // unused (a code that does not occur).
    for at in 128..good.len() {
        for flip in [1, 0x40, 0x80, 0xff] {
            let mut bytes = good.clone();
            bytes[at] ^= flip;
            let checksum = at >= good.len() - 4;
            match samples_of(&bytes) {
                Err(_) => {}
                Ok(_) if checksum => panic!("a wrong checksum at byte {at} passed"),
                Ok(samples) => assert_eq!(samples, right, "byte {at} ^ {flip:#x}"),
            }
        }
    }
}

#[test]
fn file_beyond_memory_is_refused_before_allocation() {
    let bytes = matlab::gotcha(matlab::gotcha_fields());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample.mat");
    std::fs::write(&path, &bytes).unwrap();
    let needed = gotcha::needed_bytes(bytes.len() as u64);
    assert!(gotcha::read(&path, needed).is_ok());
    let error = gotcha::read(&path, needed - 1).unwrap_err();
    assert!(matches!(error, ReadError::Memory { .. }), "{error}");
    // Files opened together share the memory: the first one's part is not available to the second.
    let options = |memory_bytes| Options {
        memory_bytes,
        ..Options::default()
    };
    let mut later = matlab::gotcha_fields();
    for (name, value) in &mut later {
        if *name == "y" {
            *value = Value::Compact(3, 1, vec![4, 5, 6]);
        }
    }
    let next = folder.path().join("next.mat");
    std::fs::write(&next, matlab::gotcha(later)).unwrap();
    let two = [&path, &next];
    assert!(open::open_all(&two, &options(needed)).is_err());
    assert!(open::open_all(&two, &options(2 * needed)).is_ok());
}
