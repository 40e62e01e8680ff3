//! What is read: CPHD, CRSD, GOTCHA, NovAtel, described recordings, several as one aperture, and what tuning finds in them.

mod aperture_order;
mod arrays;
mod channels;
mod cphd;
mod crsd;
mod described;
mod found_track;
mod gotcha;
mod hostile_files;
mod novatel;
mod tune_certainty;
