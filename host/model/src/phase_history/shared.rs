//! Phase history shared by several owners, or borrowed.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex32;

use super::{
    Beam, Channel, Collection, Defect, InputFile, NoBeam, PhaseConvention, PhaseHistory, ReadError,
};
use crate::antenna::MountedAntennas;
use crate::track::Displacement;

/// Pass every method on to the shared history.
macro_rules! shared {
    ($shared:ty) => {
        impl<H: PhaseHistory + ?Sized> PhaseHistory for $shared {
            fn collection(&self) -> &Collection {
                (**self).collection()
            }

            fn read(
                &self,
                pulses: Range<usize>,
                samples: &mut [Complex32],
            ) -> Result<(), ReadError> {
                (**self).read(pulses, samples)
            }

            fn inner(&self) -> Option<&dyn PhaseHistory> {
                (**self).inner()
            }

            fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
                (**self).samples_in_memory(pulses)
            }

            fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
                (**self).true_antennas()
            }

            fn start_ns(&self) -> Option<i64> {
                (**self).start_ns()
            }

            fn channels(&self) -> Vec<Channel> {
                (**self).channels()
            }

            fn path(&self) -> Option<&Path> {
                (**self).path()
            }

            fn phase_conventions(&self) -> Vec<PhaseConvention> {
                (**self).phase_conventions()
            }

            fn antennas(&self) -> Option<MountedAntennas> {
                (**self).antennas()
            }

            fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
                (**self).stated_beam()
            }

            fn target(&self) -> Option<&Displacement> {
                (**self).target()
            }

            fn beam(&self) -> Option<Beam> {
                (**self).beam()
            }

            fn warnings(&self) -> Vec<String> {
                (**self).warnings()
            }

            fn defects(&self) -> Vec<Defect> {
                (**self).defects()
            }

            fn held_bytes(&self) -> u64 {
                (**self).held_bytes()
            }

            fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
                (**self).inputs()
            }
        }
    };
}

shared!(Arc<H>);
shared!(&H);
