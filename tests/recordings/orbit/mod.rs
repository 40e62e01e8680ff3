//! Raw recordings from orbit, described with state vectors in ECEF.

mod ambiguity;
mod folder;
mod images;
mod vectors;
