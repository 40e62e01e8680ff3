//! Readers: CPHD, CRSD, GOTCHA, Gotcha GMTI challenge, NISAR L0B, NovAtel, arrays, described recordings, several recordings as one aperture, and tuning of their parameters.

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
mod gotcha_gmti;
mod hostile_files;
mod l0b;
mod novatel;
mod orbit;
mod positions;
mod scanner_steps;
mod stored_defects;
mod touchstone;
mod tune_certainty;
mod velocity;
