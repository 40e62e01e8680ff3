//! The gallery of both theses' figures: what the items find, and the command that makes them.

mod command;
