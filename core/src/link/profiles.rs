//! Range profiles put together again from their frames, as [`super::MapAssembly`] does maps.

use num_complex::Complex32;

use super::assembly::Transfer;
use super::{Encoding, Loss, ProfileHeader, Report, TransferChecksum, complex32s, row_bytes};

/// Puts profiles together.
#[derive(Debug)]
pub struct ProfileAssembly<'b>(Transfer<'b, ProfileHeader>);

/// A profile that came whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssembledProfile<'s> {
    /// Its number in the run.
    pub profile: u32,
    /// What it is of.
    pub header: ProfileHeader,
    /// Its bins ([`super::complex32s`]).
    pub bytes: &'s [u8],
}

impl<'b> ProfileAssembly<'b> {
    /// Nothing has come yet. Profiles that do not fit `buffer`, 8 bytes a bin, will be lost.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self(Transfer::new(buffer))
    }

    /// Takes a report; a profile if it was the end of one that came whole. Reports of no profile are ignored.
    ///
    /// # Errors
    /// [`Loss`], once a profile; those that follow are not affected.
    pub fn take(&mut self, report: &Report<'_>) -> Result<Option<AssembledProfile<'_>>, Loss> {
        match *report {
            Report::ProfileStart { profile, header } => {
                let row_bytes = row_bytes(Encoding::Complex32, header.row_bins.into());
                let checksum = TransferChecksum::new(&header);
                let rows = header.num_rows().into();
                self.0.start(profile, header, checksum, rows, row_bytes)?;
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

    /// Profiles that came whole.
    pub fn complete(&self) -> u32 {
        self.0.complete
    }

    /// Profiles that did not, of numbers up to the highest of which anything came.
    pub fn lost(&self) -> u32 {
        self.0.lost()
    }

    /// A new run: numbers and counts begin at 0.
    pub fn restart(&mut self) {
        self.0.restart();
    }
}

impl<'s> AssembledProfile<'s> {
    /// Its values, ranges ascending.
    pub fn values(&self) -> impl ExactSizeIterator<Item = Complex32> + Clone + 's {
        complex32s(self.bytes)
    }
}
