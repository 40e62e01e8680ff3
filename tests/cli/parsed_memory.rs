//! Memory of TOML and XML is estimated before parsing, and limited by `--memory`.

use std::fs;
use std::path::Path;

use subaperture::describe::memory::parsed_bytes;
use subaperture_tests::subap::{run, write_recording};

use crate::memory::{self, measured};

/// `--memory` for hostile texts, and the largest peak when they are refused, MiB.
const MIB: u32 = 64;
const REFUSED_MIB: f64 = 40.0;
/// Memory of the program itself, MiB.
const PROGRAM_MIB: f64 = 12.0;

/// Texts of about `bytes` that consist of as many instances as possible of one construct.
fn texts(bytes: usize) -> Vec<(&'static str, String)> {
    let within =
        |begin: &str, element: &str| format!("{begin}{}]\n", element.repeat(bytes / element.len()));
    let numbered = |line: &dyn Fn(usize) -> String| {
        let lines = (0..bytes / line(bytes).len()).map(line);
        format!("[radar]\n{}", lines.collect::<String>())
    };
    vec![
        ("inline tables", within("[radar]\nx=[", "{a=1},")),
        ("numbers", within("[radar]\nx=[", "1,")),
        ("arrays", within("[radar]\nx=[", "[1],")),
        ("texts", within("[radar]\nx=[", "\"a\",")),
        ("keys", numbered(&|n| format!("{n:x}=1\n"))),
        ("dotted keys", numbered(&|n| format!("{n:x}.a=1\n"))),
        ("headers", numbered(&|n| format!("[{n:x}.a]\nb=1\n"))),
        ("open arrays", format!("[radar]\nx={}", "[".repeat(bytes))),
        ("commas", format!("[radar]\nx={}", ",".repeat(bytes))),
        (
            "points",
            format!(
                "{}{}",
                memory::SCENARIO,
                "[[scene.point]]\n".repeat(bytes / 16)
            ),
        ),
    ]
}

#[test]
fn toml_of_many_values_is_refused_before_it_is_parsed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, text) in texts(4 << 20) {
        fs::write(at.join("x.toml"), text).unwrap();
        for line in [
            "info x.toml",
            "simulate x.toml -o s.cphd",
            "focus x.toml -o o",
            "tune x.toml --vary recording.range_bias=0:1:0.5m --at 1,2",
            "run x.toml",
            "capture x.toml --out c",
            "radio probe x.toml",
            "radio selftest x.toml",
            "live x.toml --out c",
        ] {
            let ran = measured(at, line, MIB);
            assert_eq!(ran.code, Some(1), "{name}: {line}: {ran:?}");
            let parts = ["expected TOML", "would need", "allow more memory"];
            let has_all = parts.iter().all(|part| ran.stderr.contains(part));
            assert!(has_all, "{name}: {line}: {ran:?}");
            assert!(ran.peak_mib <= REFUSED_MIB, "{name}: {line}: {ran:?}");
        }
    }
}

/// At least 40 bytes of text per point, 247 MiB of memory.
#[test]
fn scenario_of_100_000_points_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let points = (0..100_000).map(|n| {
        format!(
            "[[scene.point]]\nposition = \"{}.5, {}.25, 0 m\"\ncross_section = \"1 dBsm\"\n",
            n % 50 - 25,
            n / 4000 - 12
        )
    });
    let points: String = points.collect();
    fs::write(at.join("x.toml"), format!("{}{points}", memory::SCENARIO)).unwrap();
    let ran = measured(at, "info x.toml", 1024);
    assert_eq!(ran.code, Some(0), "{ran:?}");
    let ran = measured(at, "info x.toml", MIB);
    assert!(ran.stderr.contains("expected TOML"), "{ran:?}");
}

/// The estimate is an upper bound of the measured memory, and a close one.
#[test]
fn estimates_of_toml_memory_are_close_upper_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, text) in texts(1 << 20) {
        let estimate_mib = match parsed_bytes(&text, u64::MAX) {
            Ok(bytes) => bytes as f64 / f64::from(1 << 20),
            Err(found) => panic!("{name}: {}", found.message),
        };
        fs::write(at.join("x.toml"), text).unwrap();
        let ran = measured(at, "info x.toml", 1500);
        assert_eq!(ran.code, Some(1), "{name}: {ran:?}");
        assert!(!ran.stderr.contains("x.nitf needs "), "{name}: {ran:?}");
        let taken_mib = ran.peak_mib - PROGRAM_MIB;
        println!("{name}: {taken_mib:.1} MiB taken, {estimate_mib:.1} MiB estimated");
        assert!(
            taken_mib <= estimate_mib,
            "{name}: {taken_mib} {estimate_mib}"
        );
        assert!(
            estimate_mib <= 4.0 * taken_mib,
            "{name}: {taken_mib} {estimate_mib}"
        );
    }
}

#[test]
fn keys_with_very_many_parts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("x.toml"),
        format!("a{} = 1\n", ".a".repeat(100_000)),
    )
    .unwrap();
    run(at, "simulate x.toml -o s.cphd").failed(1, &["at most 64 parts"]);
}

/// A CPHD file with its XML edited.
fn edited(cphd: &[u8], edit: impl FnOnce(&str) -> String) -> Vec<u8> {
    let end = cphd.windows(2).position(|two| two == b"\x0c\n").unwrap();
    let header = std::str::from_utf8(&cphd[..end]).unwrap();
    let value = |name: &str| -> usize {
        let line = header.lines().find_map(|line| line.strip_prefix(name));
        line.unwrap().trim_start_matches(" := ").parse().unwrap()
    };
    let of = |block: &str| value(&format!("{block}_BLOCK_BYTE_OFFSET"));
    let [xml_at, pvp_at] = [of("XML"), of("PVP")];
    let old = &cphd[xml_at..xml_at + value("XML_BLOCK_SIZE")];
    let xml = edit(std::str::from_utf8(old).unwrap());
    let size = |block: &str| value(&format!("{block}_BLOCK_SIZE"));
    let (first, pvp) = (1024, 1024 + xml.len() + 2);
    let mut file = format!(
        "CPHD/1.1.0\nXML_BLOCK_SIZE := {}\nXML_BLOCK_BYTE_OFFSET := {first}\nPVP_BLOCK_SIZE := {}\nPVP_BLOCK_BYTE_OFFSET := {pvp}\n\
         SIGNAL_BLOCK_SIZE := {}\nSIGNAL_BLOCK_BYTE_OFFSET := {}\nCLASSIFICATION := U\nRELEASE_INFO := U\n\x0c\n",
        xml.len(),
        size("PVP"),
        size("SIGNAL"),
        pvp + size("PVP")
    )
    .into_bytes();
    file.resize(first, 0);
    file.extend_from_slice(xml.as_bytes());
    file.extend_from_slice(b"\x0c\n");
    file.extend_from_slice(&cphd[pvp_at..]);
    file
}

fn scenario(at: &Path) {
    write_recording(at, "x", memory::SCENARIO);
}

#[test]
fn xml_of_many_elements_is_refused_before_it_is_parsed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scenario(at);
    let cphd = fs::read(at.join("x.cphd")).unwrap();
    for element in ["<a/>", "<a b=\"\"/>", "<a>&lt;</a>", "<a>b</a>"] {
        let many = element.repeat((7 << 20) / element.len());
        let file = edited(&cphd, |xml| xml.replacen("</CPHD>", &(many + "</CPHD>"), 1));
        fs::write(at.join("x.cphd"), file).unwrap();
        for line in ["info x.cphd", "focus x.cphd -o o", "crosscheck x.cphd"] {
            let ran = measured(at, line, MIB);
            assert_eq!(ran.code, Some(1), "{element}: {line}: {ran:?}");
            assert!(ran.stderr.contains("--memory"), "{line}: {ran:?}");
            assert!(ran.peak_mib <= REFUSED_MIB, "{element}: {line}: {ran:?}");
        }
        let ran = measured(at, "info x.cphd", 1500);
        assert_eq!(ran.code, Some(0), "{element}: {ran:?}");
    }
}

#[test]
fn cphd_of_1000_channels_is_read_within_64_mebibytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scenario(at);
    let cphd = fs::read(at.join("x.cphd")).unwrap();
    let file = edited(&cphd, |xml| {
        let mut xml = xml.to_owned();
        for (begin, end) in [
            ("<Channel>", "</Channel>"),
            ("<Parameters>", "</Parameters>"),
        ] {
            let from = xml.find(begin).unwrap();
            let to = from + xml[from..].find(end).unwrap() + end.len();
            let one = xml[from..to].to_owned();
            let others = (2..=1000).map(|n| {
                let own = format!("<Identifier>{n}</Identifier>");
                one.replacen("<Identifier>1</Identifier>", &own, 1)
            });
            let others: String = others.collect();
            xml.insert_str(to, &others);
        }
        xml.replacen("<NumCPHDChannels>1<", "<NumCPHDChannels>1000<", 1)
    });
    fs::write(at.join("x.cphd"), file).unwrap();
    let ran = measured(
        at,
        "focus x.cphd --channel 1000 --grid x=-2:2:1,y=-2:2:1 -o o",
        MIB,
    );
    assert!(matches!(ran.code, Some(0 | 3)), "{ran:?}");
    assert!(ran.peak_mib <= f64::from(MIB), "{ran:?}");
}

#[test]
fn sicd_of_many_elements_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scenario(at);
    run(at, "focus x.cphd --grid x=-2:2:0.5,y=-2:2:0.5 -o image").succeeded();
    run(at, "export image -o x.nitf").succeeded();
    let mut file = fs::read(at.join("x.nitf")).unwrap();
    // The XML is the last segment. Its length and that of the file are in the header.
    let old = file.len();
    let begin = file.windows(6).rposition(|six| six == b"<SICD ").unwrap();
    let begin = file[..begin]
        .windows(5)
        .rposition(|five| five == b"<?xml")
        .unwrap_or(begin);
    let many = "<a/>".repeat(2 << 20);
    let end = file
        .windows(7)
        .rposition(|seven| seven == b"</SICD>")
        .unwrap();
    file.splice(end..end, many.bytes());
    let mut put = |before: String, after: String| {
        let place = file[..1000]
            .windows(before.len())
            .position(|w| w == before.as_bytes());
        let place = place.expect("a length in the header");
        file[place..place + before.len()].copy_from_slice(after.as_bytes());
    };
    put(format!("{old:012}"), format!("{:012}", old + many.len()));
    let xml = old - begin;
    put(format!("{xml:09}"), format!("{:09}", xml + many.len()));
    fs::write(at.join("x.nitf"), file).unwrap();
    for line in ["info x.nitf", "picture x.nitf -o o.png", "quality x.nitf"] {
        let ran = measured(at, line, MIB);
        assert_eq!(ran.code, Some(1), "{line}: {ran:?}");
        assert!(ran.stderr.contains("x.nitf needs "), "{line}: {ran:?}");
        assert!(ran.peak_mib <= REFUSED_MIB, "{line}: {ran:?}");
    }
}
