//! CPHD 1.1.0: read and written.
