//! The folder that `subap focus` leaves: image, metadata, quicklook; complete or absent.
