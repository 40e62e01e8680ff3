//! What is read: CPHD, CRSD, GOTCHA, NovAtel, described recordings, several as one aperture, and what tuning finds in them.

mod aperture_order;
mod arrays;
mod channels;
mod convention;
mod cphd;
mod crsd;
mod described;
mod fmcw_samples;
mod found_track;
mod gotcha;
mod hostile_files;
mod novatel;
mod positions;
mod tune_certainty;
