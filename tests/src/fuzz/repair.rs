//! Correction of lengths and checksums after a mutation.

use super::stuffing;

fn find(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    bytes
        .windows(pattern.len())
        .position(|window| window == pattern)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + value.len()) {
        place.copy_from_slice(value);
    }
}

/// Set the header to the positions of the XML and the blocks. The PVP block keeps its size, and the samples are the rest.
pub(super) fn cphd(bytes: &mut Vec<u8>) {
    let Some(start) = find(bytes, b"<?xml").or_else(|| find(bytes, b"<CPHD")) else {
        return;
    };
    let Some(length) = find(&bytes[start..], b"</CPHD>") else {
        return;
    };
    let xml = bytes[start..start + length + 7].to_vec();
    let rest = bytes
        .get(start + xml.len() + 2..)
        .unwrap_or_default()
        .to_vec();
    let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
    let value = |key: &str| {
        let line = header.lines().find_map(|line| line.strip_prefix(key))?;
        line.trim_start_matches([' ', ':', '='])
            .trim()
            .parse::<usize>()
            .ok()
    };
    let pvp = value("PVP_BLOCK_SIZE").unwrap_or(0).min(rest.len());
    let first = header.lines().next().unwrap_or_default();
    // The length does not depend on the numbers.
    let render = |xml_at: usize, pvp_at: usize, signal_at: usize| {
        format!(
            "{first}\nXML_BLOCK_SIZE := {:012}\nXML_BLOCK_BYTE_OFFSET := {xml_at:012}\n\
             PVP_BLOCK_SIZE := {pvp:012}\nPVP_BLOCK_BYTE_OFFSET := {pvp_at:012}\n\
             SIGNAL_BLOCK_SIZE := {:012}\nSIGNAL_BLOCK_BYTE_OFFSET := {signal_at:012}\n\
             CLASSIFICATION := U\nRELEASE_INFO := U\n\x0c\n",
            xml.len(),
            rest.len() - pvp
        )
    };
    let xml_at = render(0, 0, 0).len();
    let pvp_at = xml_at + xml.len() + 2;
    let mut whole = render(xml_at, pvp_at, pvp_at + pvp).into_bytes();
    whole.extend(&xml);
    whole.extend(b"\x0c\n");
    whole.extend(&rest);
    *bytes = whole;
}

/// Extend the first element, also a compressed one, to the end of the file.
pub(super) fn matlab(bytes: &mut [u8]) {
    let length = bytes.len().saturating_sub(136) as u32;
    put(bytes, 132, &length.to_le_bytes());
}

/// CRCs of uncompressed members, in their headers and in the directory.
pub(super) fn zip(bytes: &mut [u8]) {
    let mut at = 0;
    while let Some(found) = find(bytes.get(at..).unwrap_or_default(), b"PK\x03\x04") {
        let local = at + found;
        at = local + 4;
        let field = |offset| {
            let pair = bytes.get(local + offset..)?.first_chunk()?;
            Some(usize::from(u16::from_le_bytes(*pair)))
        };
        let (Some(name), Some(extra), Some(size)) =
            (field(26), field(28), u32_at(bytes, local + 18))
        else {
            return;
        };
        let start = local + 30 + name + extra;
        let Some(data) = bytes.get(start..start + size as usize) else {
            continue;
        };
        let crc = crc32fast::hash(data).to_le_bytes();
        put(bytes, local + 14, &crc);
        let mut entry = start;
        while let Some(found) = find(bytes.get(entry..).unwrap_or_default(), b"PK\x01\x02") {
            entry += found;
            if u32_at(bytes, entry + 42) == Some(local as u32) {
                put(bytes, entry + 16, &crc);
            }
            entry += 4;
        }
    }
}

/// CRCs of chunks.
pub(super) fn png(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(size) = bytes.get(at..).and_then(<[u8]>::first_chunk) {
        let end = at + 8 + u32::from_be_bytes(*size) as usize;
        let Some(chunk) = bytes.get(at + 4..end) else {
            return;
        };
        let crc = crc32fast::hash(chunk).to_be_bytes();
        put(bytes, end, &crc);
        at = end + 4;
    }
}

/// CRCs of preamble and sections; a section beyond the end is shortened to it.
pub(super) fn maps(bytes: &mut [u8]) {
    if bytes.len() < 16 {
        return;
    }
    let crc = crc32fast::hash(&bytes[..12]);
    put(bytes, 12, &crc.to_le_bytes());
    let mut at = 16;
    while let Some(length) = u64_at(bytes, at + 8) {
        let payload = at + 16;
        let trailer = if bytes.ends_with(b"SUBAPEND") { 16 } else { 0 };
        let room = (bytes.len() - trailer).saturating_sub(payload);
        let length = usize::try_from(length).map_or(room, |length| length.min(room));
        put(bytes, at + 8, &(length as u64).to_le_bytes());
        let tag = bytes[at..at + 4].to_vec();
        let covered = [&tag, &bytes[at + 8..payload + length]].concat();
        put(bytes, at + 4, &crc32fast::hash(&covered).to_le_bytes());
        if tag == b"TAIL" {
            let end = bytes.len();
            put(bytes, end - 16, &(at as u64).to_le_bytes());
            return;
        }
        at = payload + length;
    }
}

/// CRCs of lines, checksums of sentences, and CRCs of binary messages with a consistent length.
pub(super) fn novatel(bytes: &mut Vec<u8>) {
    let mut out = Vec::new();
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        let star = line.iter().rposition(|&byte| byte == b'*');
        match (line.first(), star) {
            (Some(b'#' | b'%'), Some(star)) => {
                out.extend(&line[..star]);
                out.extend(format!("*{:08x}\r\n", novatel_crc(&line[1..star])).bytes());
            }
            (Some(b'$'), Some(star)) => {
                let sum = line[1..star].iter().fold(0, |sum, byte| sum ^ byte);
                out.extend(&line[..star]);
                out.extend(format!("*{sum:02X}\r\n").bytes());
            }
            _ => out.extend(line),
        }
    }
    let mut at = 0;
    while at + 10 < out.len() {
        let length = match out[at..at + 10] {
            [0xaa, 0x44, 0x12, header, _, _, _, _, a, b] => {
                usize::from(header) + usize::from(u16::from_le_bytes([a, b]))
            }
            [0xaa, 0x44, 0x13, body, ..] => 12 + usize::from(body),
            _ => {
                at += 1;
                continue;
            }
        };
        if let Some(message) = out.get(at..at + length) {
            let crc = novatel_crc(message).to_le_bytes();
            put(&mut out, at + length, &crc);
        }
        at += length.max(1);
    }
    *bytes = out;
}

/// NovAtel's CRC-32: from 0, without complement at either end.
fn novatel_crc(bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new_with_initial(!0);
    hasher.update(bytes);
    !hasher.finalize()
}

/// Version, numbers, CRCs and stuffing of frames, so that mutations change the messages.
pub(super) fn frames(bytes: &mut Vec<u8>) {
    let mut out = Vec::new();
    let mut next = 0;
    for piece in stuffing::pieces(bytes) {
        let message = stuffing::message(&piece);
        // Frames that open a session have number 0.
        if message == [0] || piece.get(1..5) == Some(&[0; 4]) {
            next = 0;
        }
        out.extend(stuffing::frame(next, message));
        next += 1;
    }
    *bytes = out;
}
