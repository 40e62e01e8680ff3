//! Keys that scenarios and recordings share: the radar, how it moves, where the scene is.

#![expect(missing_docs, reason = "the explanation of a key is its documentation")]

pub mod motion;
pub mod place;
pub mod radar;
