//! Readers: CPHD, CRSD, GOTCHA, NovAtel, arrays, described recordings, several recordings as one aperture, and tuning of their parameters.

mod aperture_order;
mod arrays;
mod channels;
mod convention;
mod cphd;
mod crsd;
mod described;
mod estimated_track;
mod fmcw_samples;
mod gotcha;
mod hostile_files;
mod novatel;
mod positions;
mod tune_certainty;
