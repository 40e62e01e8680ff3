//! Bytes that are worked out by hand from the tables of the standard.

mod dwell;
mod job;
