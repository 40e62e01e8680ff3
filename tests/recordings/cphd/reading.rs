//! Reading hand-made CPHD files: formats, geometry, both domains, and every fault.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use glam::DVec3;
use num_complex::Complex32;
use subaperture::geometry::SceneFrame;
use subaperture::io::cphd::{Cphd, CphdInfo, ReferenceSurface};
use subaperture::io::open::{Options, cphd_info, open, open_all};
use subaperture::io::xml::parsed_bytes;
use subaperture::phase_history::{PhaseHistory, ReadError};

use super::by_hand::{
    ByHand, RECORD_WORDS, assemble, assert_refused, cf8, integers, open_bytes, pairs,
};
use super::scene::read_all;

#[test]
fn integer_formats_are_scaled_and_vectors_without_signal_left_out() {
    let parts = integers();
    let ci2 = parts.iter().map(|&v| v as i8 as u8).collect();
    let ci4 = parts
        .iter()
        .flat_map(|&v| (v * 100).to_be_bytes())
        .collect();
    for (format, signal, unit) in [("CI2", ci2, 1.0f32), ("CI4", ci4, 100.0)] {
        let mut by_hand = ByHand::new(format, signal);
        let plain = pairs(parts.iter().map(|&v| f32::from(v) * unit));
        let cphd = open_bytes(&by_hand.bytes()).unwrap();
        assert_eq!(read_all(&cphd).unwrap(), plain);

        // AmpSF and SIGNAL: powers of two scale exactly; vector 1 has no signal.
        by_hand.amp_sf = Some([0.5, 3.0, 0.125]);
        by_hand.signal_pvp = Some([1, 0, 1]);
        by_hand.sgn = "+1";
        by_hand.version = "1.0.1";
        let cphd = open_bytes(&by_hand.bytes()).unwrap();
        let scale = [0.5, 0.0, 0.125];
        let expected: Vec<Complex32> = plain
            .iter()
            .enumerate()
            .filter(|(i, _)| i / 4 != 1)
            .map(|(i, z)| z.conj() * scale[i / 4])
            .collect();
        assert_eq!(read_all(&cphd).unwrap(), expected);
        let mut last = vec![Complex32::ZERO; 4];
        cphd.read(1..2, &mut last).unwrap();
        assert_eq!(last, expected[4..]);
        // Times and positions are those of vectors 0 and 2.
        let times: Vec<f64> = cphd.collection().pulses.iter().map(|p| p.time_s).collect();
        assert_eq!(times, [0.5, 0.7]);
        let warnings = cphd.warnings();
        assert!(
            warnings[0].contains("vector 1 (1 of 3) is left out: SIGNAL"),
            "{warnings:?}"
        );
        // Vectors of noise count as vectors without signal.
        by_hand.signal_pvp = Some([2, 0, 1]);
        let cphd = open_bytes(&by_hand.bytes()).unwrap();
        assert_eq!(read_all(&cphd).unwrap(), expected[4..]);
        assert!(cphd.warnings()[0].contains("vectors 0 to 1 (2 of 3) are left out"));
        by_hand.amp_sf = Some([0.5, 1e-300, 0.125]);
        assert_eq!(
            read_all(&open_bytes(&by_hand.bytes()).unwrap()).unwrap(),
            expected[4..]
        );
        by_hand.amp_sf = Some([0.5, 3.0, 1e-300]);
        assert_refused(
            &by_hand.bytes(),
            "vector 2: AmpSF: expected 1e-25 to 1e25 (float32 samples), found 1e-300",
        );
        by_hand.amp_sf = Some([0.5, 3.0, 0.125]);
        by_hand.signal_pvp = Some([2, 0, 3]);
        assert_refused(&by_hand.bytes(), "SIGNAL is 0 in all of its 3 vectors");
        by_hand.signal_pvp = Some([1, 0, 1]);
        assert_eq!(cphd.info().version, "1.0.1");
        assert_eq!(cphd.info().classification.as_deref(), Some("SECRET NOT"));
    }
}

#[test]
fn geometry_is_converted_to_scene_frame() {
    let by_hand = ByHand::new("CF8", vec![0; 96]);
    let cphd = open_bytes(&by_hand.bytes()).unwrap();
    let pulse = cphd.collection().pulses[1];
    // x is ECF y, y is ECF z, so z is ECF x.
    assert_eq!(pulse.transmitter_m, DVec3::new(10.0, 4000.0, 3000.0));
    assert_eq!(pulse.receiver_m, DVec3::new(10.0, 5.0, 12.0));
    assert_eq!(pulse.reference_m, DVec3::ZERO);
    let path = (100.0f64 + 25e6).sqrt() + (100.0f64 + 25.0 + 144.0).sqrt();
    assert!((pulse.reference_path_m - path).abs() < 1e-11);
    assert_eq!((pulse.start_hz, pulse.step_hz), (9e9, 1e6));
    assert_eq!(pulse.time_s, 0.6);
    let extent = cphd.collection().extent.unwrap();
    assert_eq!((extent.x_m, extent.y_m), ((-10.0, 30.0), (-20.0, 40.0)));
}

#[test]
fn hae_surface_gives_tangent_axes() {
    let mut by_hand = ByHand::new("CF8", vec![0; 96]);
    // On the equator the meridian's radius is a (1 - e^2), the parallel's a. A displacement of 1 m 30 degrees north of east, and of 1 m
    // along the normal.
    let (a, e2) = (6_378_137.0f64, 6.694_379_990_14e-3f64);
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let (north, east) = (a * (1.0 - e2), a);
    by_hand.surface = format!(
        "<HAE><uIAXLL><Lat>{:e}</Lat><Lon>{:e}</Lon></uIAXLL>\
         <uIAYLL><Lat>{:e}</Lat><Lon>{:e}</Lon></uIAYLL></HAE>",
        sin / north,
        cos / east,
        cos / north,
        -sin / east
    );
    let cphd = open_bytes(&by_hand.bytes()).unwrap();
    assert_eq!(cphd.info().surface, ReferenceSurface::Hae);
    let SceneFrame::Earth {
        x_axis_ecf,
        y_axis_ecf,
        ..
    } = cphd.collection().frame
    else {
        panic!("not on the Earth")
    };
    assert!((x_axis_ecf - DVec3::new(0.0, cos, sin)).length() < 1e-12);
    assert!((y_axis_ecf - DVec3::new(0.0, -sin, cos)).length() < 1e-12);
    by_hand.surface = by_hand.surface.replace("uIAYLL", "gone");
    assert_refused(&by_hand.bytes(), "HAE: no element uIAYLL");
}

#[test]
fn toa_domain_follows_standard_for_both_signs() {
    // N delays from an SC0 that is no multiple of SCSS, and a band of K bins. The spectrum of a scatterer at dTOA is exp(SGN j 2 pi f
    // dTOA). By the module's definition s(toa) = 1/K sum_f S(f) exp(-SGN j 2 pi (f - fx_C) toa), summed here term by term.
    let (n, scss, sc0, d_toa) = (40, 5e-9, -77.3e-9, 21.7e-9);
    let spacing = 1.0 / (n as f64 * scss);
    for k in [30usize, 31] {
        for (sgn, sign) in [("-1", -1.0), ("+1", 1.0)] {
            let fx_c = 9.6e9;
            let frequencies: Vec<f64> = (0..k)
                .map(|i| fx_c + (i as f64 - (k / 2) as f64) * spacing)
                .collect();
            let mut vector = Vec::new();
            for s in 0..n {
                let toa = sc0 + s as f64 * scss;
                let (mut re, mut im) = (0.0, 0.0);
                for f in &frequencies {
                    let cycles = sign * (f * d_toa - (f - fx_c) * toa);
                    re += (TAU * cycles).cos() / k as f64;
                    im += (TAU * cycles).sin() / k as f64;
                }
                vector.push(Complex32::new(re as f32, im as f32));
            }
            let peak = (0..n)
                .max_by(|&a, &b| vector[a].norm().total_cmp(&vector[b].norm()))
                .unwrap();
            // The peak is at dTOA (sample 19.8), near 1, with phase SGN fx_C dTOA as the standard states. At 0.2 samples from the peak the
            // phase changes little.
            assert_eq!(peak, 20);
            let half = 0.5 * k as f64 * spacing;
            let by_hand = ByHand {
                domain: "TOA",
                sgn,
                num_samples: n,
                axis: [sc0, scss, fx_c - half, fx_c + half],
                ..ByHand::new("CF8", cf8(&[&vector[..]; 3].concat()))
            };
            let cphd = open_bytes(&by_hand.bytes()).unwrap();
            assert_eq!(cphd.collection().num_samples, k);
            let pulse = cphd.collection().pulses[0];
            let samples = read_all(&cphd).unwrap();
            for (i, z) in samples[..k].iter().enumerate() {
                let f = pulse.frequency_hz(i);
                // 1e-6 Hz: rounding at 9.6e9 Hz.
                assert!((f - frequencies[i]).abs() < 2e-6);
                let (im, re) = (-TAU * f * d_toa).sin_cos();
                // The sum of 40 samples of at most 1, each rounded by 2^-25: well below 1e-6.
                let error = (f64::from(z.re) - re).hypot(f64::from(z.im) - im);
                assert!(error < 1e-6, "{k} {sgn} {i}: {error:e}");
            }
            let other = ByHand {
                axis: [sc0, scss, fx_c - half, fx_c + 4.0 * half],
                ..by_hand.clone()
            };
            assert_refused(&other.bytes(), "vector 0: the band FX1 to FX2");
        }
    }
}

#[test]
fn faults_are_named() {
    let good = ByHand::new("CF8", vec![0; 96]);
    open_bytes(&good.bytes()).unwrap();

    // Remove each required element in turn.
    let xml = good.xml();
    for name in [
        "Global",
        "DomainType",
        "SGN",
        "SceneCoordinates",
        "IARP",
        "ECF",
        "ReferenceSurface",
        "uIAX",
        "uIAY",
        "ImageArea",
        "X1Y1",
        "X2Y2",
        "Data",
        "SignalArrayFormat",
        "NumBytesPVP",
        "Identifier",
        "NumVectors",
        "NumSamples",
        "SignalArrayByteOffset",
        "PVPArrayByteOffset",
        "RefChId",
        "PVP",
        "TxTime",
        "TxPos",
        "RcvPos",
        "SRPPos",
        "SC0",
        "SCSS",
        "FX1",
        "FX2",
        "Offset",
        "Format",
    ] {
        let renamed = xml
            .replace(&format!("<{name}>"), "<gone>")
            .replace(&format!("</{name}>"), "</gone>");
        let file = assemble("1.1.0", &renamed, &good.pvp(), &good.signal);
        assert_refused(&file, &format!("no element {name}"));
    }
    let changed = |from: &str, to: &str, part: &str| {
        assert!(xml.contains(from));
        let file = assemble("1.1.0", &xml.replace(from, to), &good.pvp(), &good.signal);
        assert_refused(&file, part);
    };
    changed(
        ">FX<",
        ">XF<",
        "CPHD/Global/DomainType: expected FX or TOA, found 'XF'",
    );
    changed("<SGN>-1", "<SGN>0", "found '0'");
    changed(
        ">CF8<",
        ">CF16<",
        "SignalArrayFormat: expected CI2, CI4 or CF8, found 'CF16'",
    );
    changed(
        "</SignalArrayFormat>",
        "</SignalArrayFormat><SignalCompressionID>zip</SignalCompressionID>",
        "compressed ('zip')",
    );
    changed("<NumVectors>3", "<NumVectors>0", "NumVectors: 0");
    changed(
        "<NumVectors>3",
        "<NumVectors>4",
        "does not fit the PVP block",
    );
    changed("<NumVectors>3", "<NumVectors>-3", "found '-3'");
    changed("<NumSamples>4", "<NumSamples>0", "NumSamples: 0");
    changed(
        "<NumSamples>4",
        "<NumSamples>5",
        "does not fit the signal block",
    );
    for huge in ["4611686018427387904", "18446744073709551615"] {
        changed(
            "<NumVectors>3",
            &format!("<NumVectors>{huge}"),
            "does not fit",
        );
        changed(
            "<NumSamples>4",
            &format!("<NumSamples>{huge}"),
            "does not fit",
        );
        changed(
            "ByteOffset>0",
            &format!("ByteOffset>{huge}"),
            "does not fit",
        );
        changed("<Offset>14", &format!("<Offset>{huge}"), "FX2/Offset: word");
    }
    changed(
        "<Offset>14",
        "<Offset>20",
        "FX2/Offset: word 20 lies outside",
    );
    changed(
        "<NumSamples>4",
        "<NumSamples><a/>4",
        "NumSamples: expected a number",
    );
    changed(">160<", ">161<", "NumBytesPVP: 161");
    changed(">160<", ">18446744073709551608<", "NumBytesPVP: 1844");
    changed(
        "<RefChId>only",
        "<RefChId>other",
        "CPHD/Channel/RefChId: unknown channel 'other'",
    );
    changed("<Y>1</Y>", "<Y>2</Y>", "not orthogonal unit vectors");
    changed(
        "<X>6378137</X>",
        "<X>1</X>",
        "expected a position near the Earth",
    );
    changed(
        "<X>6378137</X>",
        "<X>inf</X>",
        "ECF/X: expected a finite number, found 'inf'",
    );
    changed("<X>30</X>", "<X>-30</X>", "expected X1Y1 below X2Y2");
    changed("</CPHD>", "</CPHX>", "not well formed");
    changed(
        "<Global>",
        "<!DOCTYPE a [<!ENTITY b \"c\">]><Global>",
        "not well formed",
    );

    // Parameters of vector 1.
    let spoiled = |word: usize, value: f64, part: &str| {
        let mut pvp = good.pvp();
        let at = (RECORD_WORDS + word) * 8;
        pvp[at..at + 8].copy_from_slice(&value.to_be_bytes());
        assert_refused(&assemble("1.1.0", &xml, &pvp, &good.signal), part);
    };
    spoiled(
        2,
        f64::NAN,
        "vector 1: TxTime: expected a finite number, found NaN",
    );
    spoiled(
        6,
        f64::INFINITY,
        "vector 1: TxPos: expected a finite number, found inf",
    );
    spoiled(
        9,
        f64::NAN,
        "vector 1: RcvPos: expected a finite number, found NaN",
    );
    spoiled(
        12,
        f64::NAN,
        "vector 1: SRPPos: expected a finite number, found NaN",
    );
    spoiled(4, 1e308, "vector 1: its transmitter at (");
    spoiled(7, 2e10, "vector 1: its receiver at (");
    spoiled(2, 1e300, "vector 1: its time 1e300 s");
    // Finite, but outside the range of any radar.
    spoiled(0, 5e245, "vector 1: expected a frequency from");
    spoiled(1, 5e245, "vector 1: expected a frequency step from");
    spoiled(
        1,
        0.0,
        "vector 1: SCSS: expected a positive sample spacing, found 0.0",
    );
    spoiled(
        1,
        -1e6,
        "vector 1: SCSS: expected a positive sample spacing, found -1000000.0",
    );
    spoiled(
        0,
        0.0,
        "vector 1: SC0: expected a positive frequency, found 0.0 Hz",
    );
    spoiled(14, 9e9, "vector 1: FX1: expected a value below FX2");

    // A non-finite sample is reported by pulse and sample.
    let mut signal = vec![0; 96];
    signal[(4 + 3) * 8 + 4..(4 + 3) * 8 + 8].copy_from_slice(&f32::NAN.to_be_bytes());
    let cphd = open_bytes(&ByHand::new("CF8", signal).bytes()).unwrap();
    let mut two = vec![Complex32::ZERO; 8];
    match cphd.read(1..3, &mut two) {
        Err(ReadError::NotFinite { pulse, sample, .. }) => assert_eq!((pulse, sample), (1, 3)),
        other => panic!("{other:?}"),
    }
    let mut one = vec![Complex32::ZERO; 4];
    cphd.read(2..3, &mut one).unwrap();
}

#[test]
fn wrong_header_values_are_named() {
    let good = ByHand::new("CF8", vec![0; 96]).bytes();
    let text = |from: &str, to: &str| {
        let from = from.as_bytes();
        let at = good.windows(from.len()).position(|w| w == from).unwrap();
        [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
    };
    assert_refused(b"", "the file is empty");
    assert_refused(b"MATLAB 5.0 MAT-file", "expected 'CPHD/1.1.0' at the start");
    assert_refused(&text("CPHD/1.1.0", "CPHD/2.0.0"), "found '2.0.0'");
    assert_refused(
        &text("PVP_BLOCK_SIZE", "PVP_BLICK_SIZE"),
        "required key PVP_BLOCK_SIZE is missing",
    );
    assert_refused(
        &text(
            "XML_BLOCK_BYTE_OFFSET := 512",
            "XML_BLOCK_BYTE_OFFSET := 12",
        ),
        "within the header",
    );
    assert_refused(
        &text("OFFSET := 512", "OFFSET := -12"),
        "expected a number of bytes",
    );
    assert_refused(&text(" := 512", " : 512"), "is not 'KEY := value'");
    for size in ["99999999", "18446744073709551615", "4000000000000"] {
        let lie = text("XML_BLOCK_SIZE := ", &format!("XML_BLOCK_SIZE := {size}"));
        let error = open_bytes(&lie).err().unwrap().to_string();
        // Beyond the end of the file, or beyond 64 bits.
        assert!(
            error.contains("cut short") || error.contains("expected a number of bytes"),
            "{error}"
        );
    }
}

#[test]
fn file_truncated_after_opening_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.cphd");
    let bytes = ByHand::new("CF8", vec![0; 96]).bytes();
    std::fs::write(&path, &bytes).unwrap();
    let cphd = Cphd::open(&path, None, u64::MAX).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(bytes.len() as u64 - 1).unwrap();
    let error = read_all(&cphd).unwrap_err().to_string();
    assert!(error.contains("has been shortened"), "{error}");
    assert!(cphd.inputs().is_err());
}

#[test]
fn xml_comments_and_instructions_are_not_text() {
    let hand = ByHand::new("CF8", vec![0; 96]);
    let mut commented = hand.xml();
    for (from, to) in [
        ("<Identifier>only", "<Identifier><!-- c -->on<?p i?>ly"),
        ("<RefChId>only", "<RefChId>only<!-- c -->"),
        ("<SGN>-1", "<SGN><!-- c --> -1"),
        ("<NumSamples>4", "<NumSamples><!---->4<?p?> "),
        ("<X>30<", "<X>3<![CDATA[0]]><!-- c --><"),
    ] {
        assert!(commented.contains(from));
        commented = commented.replace(from, to);
    }
    let bytes = assemble(hand.version, &commented, &hand.pvp(), &hand.signal);
    let plain = open_bytes(&hand.bytes()).unwrap();
    assert_eq!(open_bytes(&bytes).unwrap().info(), plain.info());
}

#[test]
fn empty_support_block_is_accepted() {
    let hand = ByHand::new("CF8", vec![0; 96]);
    let with_support = |size: &str| {
        let mut bytes = hand.bytes();
        let end = bytes.windows(2).position(|w| w == b"\x0c\n").unwrap();
        let lines =
            format!("SUPPORT_BLOCK_SIZE := {size}\nSUPPORT_BLOCK_BYTE_OFFSET := 512\n\x0c\n");
        // In the padding after the header.
        bytes[end..end + lines.len()].copy_from_slice(lines.as_bytes());
        bytes
    };
    open_bytes(&with_support("0")).unwrap();
    open_bytes(&with_support("8")).unwrap();
    assert_refused(&with_support("1000000"), "the SUPPORT block takes");
}

#[test]
fn file_beyond_memory_is_refused_before_allocation() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.cphd");
    let hand = ByHand::new("CF8", vec![0; 96]);
    // A small file: its XML needs most of the memory.
    std::fs::write(&path, hand.bytes()).unwrap();
    let xml = parsed_bytes(&hand.xml());
    let refusal = |memory_bytes| match Cphd::open(&path, None, memory_bytes) {
        Ok(_) => 0,
        Err(ReadError::Memory { needed_bytes, .. }) => needed_bytes,
        Err(error) => panic!("{error}"),
    };
    assert_eq!(refusal(xml), 0);
    assert_eq!(refusal(xml - 1), xml);

    // More than a TiB of zeros: 2^33 records of 160 bytes, with one sample of 2 bytes each. 240 + 17 bytes are kept for each vector, and
    // records are read 1 MiB at a time.
    let vectors = 1u64 << 33;
    let huge = ByHand {
        num_vectors: vectors.to_string(),
        num_samples: 1,
        ..ByHand::new("CI2", Vec::new())
    };
    let pvp_bytes = vectors * 160;
    let xml = huge.xml();
    let pvp_at = 512 + xml.len() as u64 + 2;
    let mut start = format!(
        "CPHD/1.1.0\nXML_BLOCK_SIZE := {}\nXML_BLOCK_BYTE_OFFSET := 512\n\
         PVP_BLOCK_SIZE := {pvp_bytes}\nPVP_BLOCK_BYTE_OFFSET := {pvp_at}\n\
         SIGNAL_BLOCK_SIZE := {}\nSIGNAL_BLOCK_BYTE_OFFSET := {}\n\x0c\n",
        xml.len(),
        2 * vectors,
        pvp_at + pvp_bytes,
    )
    .into_bytes();
    start.resize(512, 0);
    start.extend_from_slice(xml.as_bytes());
    std::fs::write(&path, &start).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(pvp_at + pvp_bytes + 2 * vectors).unwrap();
    assert_eq!(refusal(1 << 30), vectors * (264 + 17) + (1 << 20));
    // Its metadata can still be read.
    let info = CphdInfo::read(&path).unwrap();
    assert_eq!(info.channels[0].num_vectors, vectors);
    assert_eq!(cphd_info(&path, 1 << 20).unwrap(), Some(info));
    let options = Options {
        memory_bytes: 1 << 30,
        ..Options::default()
    };
    assert!(matches!(
        open(&path, &options),
        Err(ReadError::Memory { .. })
    ));
}

#[test]
fn xml_of_more_than_8_mib_is_refused() {
    let hand = ByHand::new("CF8", vec![0; 96]);
    let padded = |len: usize| {
        let mut xml = hand.xml();
        xml.extend(std::iter::repeat_n(' ', len - xml.len()));
        assemble(hand.version, &xml, &hand.pvp(), &hand.signal)
    };
    open_bytes(&padded(8 << 20)).unwrap();
    assert_refused(&padded((8 << 20) + 1), "XML_BLOCK_SIZE 8388609");
}

#[test]
fn recordings_of_one_aperture_share_memory_budget() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.cphd");
    let hand = ByHand::new("CF8", vec![0; 96]);
    std::fs::write(&path, hand.bytes()).unwrap();
    // Another band, so that no pulse is in both.
    let mut other = hand.clone();
    other.axis = [9.1e9, 1e6, 9.1e9, 9.103e9];
    let next = folder.path().join("next.cphd");
    std::fs::write(&next, other.bytes()).unwrap();
    let all = |memory_bytes| {
        let options = Options {
            memory_bytes,
            ..Options::default()
        };
        open_all(&[&path, &next], &options).map(|aperture| aperture.held_bytes())
    };
    // While the second file is opened, the first one is in memory.
    let held = 3 * (264 + 17);
    let needed = parsed_bytes(&hand.xml()) + held;
    // Their times are the same, so pulses alternate: a block of 24 bytes for each.
    assert_eq!(all(needed).unwrap(), 2 * held + 2 * 3 * (264 + 24));
    assert!(matches!(all(needed - 1), Err(ReadError::Memory { .. })));
}

#[test]
fn deeply_nested_xml_is_refused() {
    let xml = "<a>".repeat(300_000);
    assert_refused(
        &assemble("1.1.0", &xml, &[0; 8], &[0; 8]),
        "not well formed",
    );
    let xml = format!("{}{}", "<a>".repeat(300_000), "</a>".repeat(300_000));
    assert_refused(&assemble("1.1.0", &xml, &[0; 8], &[0; 8]), "root element");
}

/// Path of the example in the project's data folder, which may be missing.
fn example() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .join("../shared/data/nga-xml/0000-syntax-only-cphd-1.1.0.xml")
}

#[test]
fn syntax_example_of_standard_is_parsed() {
    let path = example();
    let Ok(xml) = std::fs::read_to_string(&path) else {
        println!("skipped: {} not found", path.display());
        return;
    };
    let info = CphdInfo::from_xml(&xml).unwrap();
    assert_eq!(info.version, "1.1.0");
    assert_eq!(info.collector_name.as_deref(), Some("SyntheticCollector"));
    assert_eq!(
        info.illuminator_name.as_deref(),
        Some("DifferentThanCollector")
    );
    assert_eq!(info.core_name.as_deref(), Some("SyntheticCore"));
    assert_eq!(info.mode_id.as_deref(), Some("Syntax-only Mode"));
    assert_eq!(info.surface, ReferenceSurface::Hae);
    assert_eq!(info.compression.as_deref(), Some("1"));
    assert_eq!(info.tx_time_s, Some((0.0, 2.539289679962638)));
    assert_eq!(info.toa_swath_s.unwrap().1, 6.1892989277891546e-06);
    assert_eq!(info.image_area.x_m, (-1500.0, 1500.0));
    let channel = &info.channels[0];
    assert_eq!((channel.num_vectors, channel.num_samples), (3268, 5223));
    assert_eq!(channel.fx_c_hz, Some(1e10));
    assert_eq!(channel.tx_polarization.as_deref(), Some("S"));
}
