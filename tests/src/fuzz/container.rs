//! Two files in one input: the length of the first, its bytes, the second's bytes.

/// Both in one.
pub(super) fn pack(first: &[u8], second: &[u8]) -> Vec<u8> {
    let length = (first.len() as u32).to_le_bytes();
    [&length[..], first, second].concat()
}

/// Both files; an input of any form is split as far as possible.
pub(super) fn unpack(bytes: &[u8]) -> (&[u8], &[u8]) {
    let Some((length, rest)) = bytes.split_first_chunk() else {
        return (bytes, &[]);
    };
    let length = u32::from_le_bytes(*length) as usize;
    rest.split_at(length.min(rest.len()))
}
