//! Reassembly of range profiles from frames, like [`super::MapAssembly`] for maps.

use num_complex::Complex32;

use super::assembly::{Rows, Transfer};
use super::{Encoding, Loss, ProfileHeader, Report, TransferChecksum, complex32s, row_bytes};

/// Reassembly of range profiles.
#[derive(Debug)]
pub struct ProfileAssembly<'b>(Transfer<'b, ProfileHeader>);

/// Completely received range profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssembledProfile<'s> {
    /// Number of the profile in the run.
    pub profile: u32,
    /// Sweep, carriers and sample count of the profile.
    pub header: ProfileHeader,
    /// Range bins ([`super::complex32s`]).
    pub bytes: &'s [u8],
}

impl<'b> ProfileAssembly<'b> {
    /// Create an assembly without received data. Profiles that exceed `buffer` (8 bytes per bin) will be lost.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self(Transfer::new(buffer))
    }

    /// Process a report. Returns a profile if the report completes it. Reports that do not belong to a profile are ignored.
    ///
    /// # Errors
    /// [`Loss`], at most once per profile. Later profiles are not affected.
    pub fn take(&mut self, report: &Report<'_>) -> Result<Option<AssembledProfile<'_>>, Loss> {
        match *report {
            Report::ProfileStart { profile, header } => {
                let row_bytes = row_bytes(Encoding::Complex32, header.row_bins.into());
                let checksum = TransferChecksum::new(&header);
                let rows = Rows::equal(header.num_rows().into(), row_bytes);
                self.0.start(profile, header, checksum, rows)?;
                Ok(None)
            }
            Report::ProfileRow {
                profile,
                row,
                samples,
            } => {
                self.0.row(profile, row, samples)?;
                Ok(None)
            }
            Report::ProfileEnd { profile, rows, crc } => {
                let whole = self.0.end(profile, rows, crc)?;
                Ok(whole.map(|(header, bytes)| AssembledProfile {
                    profile,
                    header,
                    bytes,
                }))
            }
            _ => Ok(None),
        }
    }

    /// Number of complete profiles.
    pub fn complete(&self) -> u32 {
        self.0.complete
    }

    /// Number of lost profiles, up to the highest profile number received.
    pub fn lost(&self) -> u32 {
        self.0.lost()
    }

    /// Start a new run: profile numbers and counts start at 0.
    pub fn restart(&mut self) {
        self.0.restart();
    }
}

impl<'s> AssembledProfile<'s> {
    /// Values in ascending range.
    pub fn values(&self) -> impl ExactSizeIterator<Item = Complex32> + Clone + 's {
        complex32s(self.bytes)
    }
}
