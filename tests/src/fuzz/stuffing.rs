//! Frames of the link by their description: stuffing, numbers and checksums.

/// Bytes between zeros without stuffing; invalid stuffing is ignored.
pub fn pieces(wire: &[u8]) -> Vec<Vec<u8>> {
    let pieces = wire
        .split(|&byte| byte == 0)
        .filter(|piece| !piece.is_empty());
    pieces.map(unstuffed).collect()
}

fn unstuffed(piece: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut at = 0;
    while let Some(&code) = piece.get(at) {
        let end = (at + usize::from(code)).min(piece.len());
        out.extend(&piece[(at + 1).min(end)..end]);
        at = end.max(at + 1);
        if code < 255 && at < piece.len() {
            out.push(0);
        }
    }
    out
}

fn stuffed(body: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut runs = body.split(|&byte| byte == 0).peekable();
    while let Some(run) = runs.next() {
        let mut chunks = run.chunks(254).peekable();
        if run.is_empty() {
            out.push(1);
        }
        while let Some(chunk) = chunks.next() {
            out.push(chunk.len() as u8 + 1);
            out.extend(chunk);
            // A chunk of 254 bytes has no zero after it: a following one needs its own code.
            if chunk.len() == 254 && chunks.peek().is_none() && runs.peek().is_some() {
                out.push(1);
            }
        }
    }
    out
}

/// The numbered frame of a message.
pub fn frame(sequence: u32, message: &[u8]) -> Vec<u8> {
    let mut body = vec![3];
    body.extend(sequence.to_le_bytes());
    body.extend(message);
    body.extend(crc32fast::hash(&body).to_le_bytes());
    let mut wire = stuffed(&body);
    wire.push(0);
    wire
}

/// The message of an unstuffed frame, as far as it is complete.
pub fn message(body: &[u8]) -> &[u8] {
    body.get(5..body.len().saturating_sub(4)).unwrap_or(&[])
}
