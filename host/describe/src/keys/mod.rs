//! Keys shared by scenarios and recordings: radar, motion, position of the scene.

#![expect(missing_docs, reason = "the description of a key is its documentation")]

pub mod motion;
pub mod place;
pub mod radar;
