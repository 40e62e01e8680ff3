//! CRSD: raw echoes with their pulses.

use subaperture::io::crsd::{Crsd, CrsdInfo};
use subaperture::io::open::{Options, open_sum};

use super::MEMORY_BYTES;
use super::recordings::examine;
use super::scratch::with_files;

pub(super) const WORDS: &[&str] = &[
    "<Channel>",
    "</Channel>",
    "<TxSequence>",
    "<NumPulses>",
    "<NumVectors>",
    "<NumSamples>",
    "PPPArrayByteOffset",
    "PVPArrayByteOffset",
    "SignalArrayByteOffset",
    "<Fs>1e300</Fs>",
    "Int=I8;Frac=F8;",
    ">LFM w XM<",
    ">CI2<",
    "CRSDrcv",
    "PPP_BLOCK_SIZE := ",
];

/// Blocks in the order of a file.
const BLOCKS: [&str; 4] = ["SUPPORT", "PPP", "PVP", "SIGNAL"];

const PULSES: [(&str, &str); 9] = [
    ("TxTime", "Int=I8;Frac=F8;"),
    ("TxPos", "X=F8;Y=F8;Z=F8;"),
    ("TxVel", "X=F8;Y=F8;Z=F8;"),
    ("FX1", "F8"),
    ("FX2", "F8"),
    ("TXmt", "F8"),
    ("PhiX0", "Int=I8;Frac=F8;"),
    ("FxFreq0", "F8"),
    ("FxRate", "F8"),
];

const VECTORS: [(&str, &str); 12] = [
    ("RcvStart", "Int=I8;Frac=F8;"),
    ("RcvPos", "X=F8;Y=F8;Z=F8;"),
    ("RcvVel", "X=F8;Y=F8;Z=F8;"),
    ("FRCV1", "F8"),
    ("FRCV2", "F8"),
    ("RefPhi0", "Int=I8;Frac=F8;"),
    ("RefFreq", "F8"),
    ("DFIC0", "F8"),
    ("FICRate", "F8"),
    ("SIGNAL", "I8"),
    ("AmpSF", "F8"),
    ("TxPulseIndex", "I8"),
];

fn words(format: &str) -> usize {
    match format {
        "X=F8;Y=F8;Z=F8;" => 3,
        "Int=I8;Frac=F8;" => 2,
        _ => 1,
    }
}

/// The XML branch, and the length of a record.
fn branch(name: &str, fields: &[(&str, &str)]) -> (String, usize) {
    let (mut text, mut at) = (String::new(), 0);
    for (field, format) in fields {
        let size = words(format);
        text += &format!(
            "<{field}><Offset>{at}</Offset><Size>{size}</Size><Format>{format}</Format></{field}>"
        );
        at += size;
    }
    (format!("<{name}>{text}</{name}>"), 8 * at)
}

/// A header whose length does not depend on its numbers.
fn header(first: &str, xml: [usize; 2], blocks: [[usize; 2]; 4]) -> String {
    let mut text = format!("{first}\n");
    let names = ["XML"].into_iter().chain(BLOCKS);
    for (name, [size, at]) in names.zip([xml].into_iter().chain(blocks)) {
        text += &format!("{name}_BLOCK_SIZE := {size:012}\n{name}_BLOCK_BYTE_OFFSET := {at:012}\n");
    }
    text + "CLASSIFICATION := U\nRELEASE_INFO := U\n\x0c\n"
}

/// A complete file of these blocks.
fn file(first: &str, xml: &[u8], blocks: [&[u8]; 4]) -> Vec<u8> {
    let mut at = header(first, [0; 2], [[0; 2]; 4]).len();
    let xml_at = at;
    at += xml.len() + 2;
    let places = blocks.map(|block| {
        let place = [block.len(), at];
        at += block.len();
        place
    });
    let mut whole = header(first, [xml.len(), xml_at], places).into_bytes();
    whole.extend(xml);
    whole.extend(b"\x0c\n");
    blocks.iter().for_each(|block| whole.extend(*block));
    whole
}

/// Set the header to the positions of the XML and the blocks. All blocks except the last keep their sizes.
pub(super) fn repair(bytes: &mut Vec<u8>) {
    let find = |pattern: &[u8]| {
        bytes
            .windows(pattern.len())
            .position(|window| window == pattern)
    };
    let (Some(start), Some(end)) = (find(b"<CRSDsar"), find(b"</CRSDsar>")) else {
        return;
    };
    let Some(xml) = bytes.get(start..end + 10) else {
        return;
    };
    let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
    let size = |name: &str| -> usize {
        let key = format!("{name}_BLOCK_SIZE");
        let line = header.lines().find_map(|line| line.strip_prefix(&key));
        let number = line.map(|line| line.trim_start_matches([' ', ':', '=']).trim());
        number.and_then(|number| number.parse().ok()).unwrap_or(0)
    };
    let mut rest = bytes.get(end + 12..).unwrap_or_default();
    let blocks = BLOCKS.map(|name| {
        let most = rest.len();
        let (block, others) = rest.split_at(match name {
            "SIGNAL" => most,
            _ => size(name).min(most),
        });
        rest = others;
        block
    });
    let first = header.lines().next().unwrap_or_default();
    *bytes = file(first, xml, blocks);
}

/// Four pulses of 20 samples in windows of 32; one is noise only.
fn seed(format: &str, sample_bytes: usize) -> Vec<u8> {
    let (count, samples) = (4usize, 32usize);
    let (ppp_xml, ppp_bytes) = branch("PPP", &PULSES);
    let (pvp_xml, pvp_bytes) = branch("PVP", &VECTORS);
    let radius = "<X>6378137.0</X><Y>0.0</Y><Z>0.0</Z>";
    let xml = format!(
        "<CRSDsar xmlns=\"http://api.nsgreg.nga.mil/schema/crsd/1.0\"><ProductInfo><ProductName>seed</ProductName></ProductInfo>\
         <Global><CollectionRefTime>2026-01-01T00:00:00Z</CollectionRefTime></Global>\
         <SceneCoordinates><IARP><ECF>{radius}</ECF></IARP><ReferenceSurface><Planar><uIAX><X>0</X><Y>1</Y><Z>0</Z></uIAX>\
         <uIAY><X>0</X><Y>0</Y><Z>1</Z></uIAY></Planar></ReferenceSurface>\
         <ImageArea><X1Y1><X>-20</X><Y>-20</Y></X1Y1><X2Y2><X>20</X><Y>20</Y></X2Y2></ImageArea></SceneCoordinates>\
         <Data><Transmit><NumBytesPPP>{ppp_bytes}</NumBytesPPP><NumTxSequences>1</NumTxSequences>\
         <TxSequence><TxId>T</TxId><NumPulses>{count}</NumPulses><PPPArrayByteOffset>0</PPPArrayByteOffset></TxSequence></Transmit>\
         <Receive><SignalArrayFormat>{format}</SignalArrayFormat><NumBytesPVP>{pvp_bytes}</NumBytesPVP><NumCRSDChannels>1</NumCRSDChannels>\
         <Channel><ChId>R</ChId><NumVectors>{count}</NumVectors><NumSamples>{samples}</NumSamples>\
         <SignalArrayByteOffset>0</SignalArrayByteOffset><PVPArrayByteOffset>0</PVPArrayByteOffset></Channel></Receive></Data>\
         <TxSequence><RefTxId>T</RefTxId><TxWFType>LFM</TxWFType></TxSequence>\
         <Channel><RefChId>R</RefChId><Parameters><Identifier>R</Identifier><Fs>10e6</Fs>\
         <SARImage><TxId>T</TxId></SARImage></Parameters></Channel>\
         <ReferenceGeometry><RefPoint><ECF>{radius}</ECF></RefPoint></ReferenceGeometry>{ppp_xml}{pvp_xml}</CRSDsar>"
    );
    let float =
        |values: &[f64]| -> Vec<u8> { values.iter().flat_map(|v| v.to_be_bytes()).collect() };
    let pair = |whole: i64, fraction: f64| [whole.to_be_bytes(), fraction.to_be_bytes()].concat();
    let (mut ppp, mut pvp) = (Vec::new(), Vec::new());
    for n in 0..count {
        let place = [6_378_137.0 + 3000.0, -4000.0, 10.0 * n as f64];
        ppp.extend(pair(1, 0.1 * n as f64));
        ppp.extend(float(&place));
        ppp.extend(float(&[0.0, 0.0, 100.0, 9.596e9, 9.604e9, 2e-6]));
        ppp.extend(pair(3, 0.25));
        ppp.extend(float(&[9.6e9, 4e12]));
        pvp.extend(pair(1, 0.1 * n as f64 + 32e-6));
        pvp.extend(float(&place));
        pvp.extend(float(&[0.0, 0.0, 100.0, 9.595e9, 9.605e9]));
        pvp.extend(pair(-2, 0.5));
        pvp.extend(float(&[9.6e9, 0.0, 0.0]));
        let noise = n == 2;
        pvp.extend(if noise { 2i64 } else { 1 }.to_be_bytes());
        pvp.extend(float(&[0.5]));
        pvp.extend(if noise { -1i64 } else { n as i64 }.to_be_bytes());
    }
    let mut signal: Vec<u8> = Vec::new();
    for i in 0..count * samples * sample_bytes / 4 {
        let value = (i as f32 * 0.7).sin();
        match sample_bytes {
            8 => signal.extend(value.to_be_bytes()),
            _ => signal.extend([1u8, 2, 253, i as u8]),
        }
    }
    signal.truncate(count * samples * sample_bytes);
    file(
        "CRSDsar/1.0",
        xml.as_bytes(),
        [&[0; 8], &ppp, &pvp, &signal],
    )
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    vec![seed("CF8", 8), seed("CI4", 4), seed("CI2", 2)]
}

pub(super) fn read(bytes: &[u8]) -> String {
    with_files(&[("input.crsd", bytes)], |folder| {
        let path = folder.join("input.crsd");
        let info = match CrsdInfo::read(&path) {
            Ok(info) => format!("{} channels", info.channels.len()),
            Err(error) => return error.to_string(),
        };
        let opened = match Crsd::open(&path, None, MEMORY_BYTES) {
            Ok(history) => examine(&history, bytes),
            Err(error) => error.to_string(),
        };
        let options = Options {
            memory_bytes: MEMORY_BYTES,
            ..Options::default()
        };
        let summed = match open_sum::<_, &str>(&[&path], None, &options) {
            Ok(sum) => examine(&sum, bytes),
            Err(error) => error.to_string(),
        };
        format!("{info} {opened} {summed}")
    })
}
