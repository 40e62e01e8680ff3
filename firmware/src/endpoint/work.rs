//! Order of work.

use subaperture_core::link::State;
use subaperture_core::stream::Progress;

use super::module::Module;
use super::transfer::Transfer;
use crate::engine::WireEngine;

impl<E: WireEngine> Module<'_, E> {
    /// Do one processing step, unless a map waits to be sent. Returns whether there was a step to do.
    pub(super) fn work(&mut self) -> bool {
        if self.increments.is_configured() {
            return self.work_on_increments();
        }
        if self.profiles.is_configured() {
            return self.work_on_profiles();
        }
        match self.transfer {
            Transfer::Nothing => {}
            Transfer::Products => {
                let (setup, map) = (self.processor.setup(), self.processor.map());
                let more = setup
                    .zip(map)
                    .is_some_and(|(setup, map)| self.products.work(setup, &map));
                if !more {
                    self.transfer = Transfer::MapStart;
                }
                return true;
            }
            _ => return false,
        }
        match self.processor.work() {
            Progress::Busy => true,
            Progress::Map => {
                if let Some(map) = self.processor.map() {
                    self.products.begin_map(&map);
                    self.transfer = Transfer::Products;
                }
                true
            }
            Progress::Idle => {
                if self.state == State::Finishing {
                    self.finish();
                }
                false
            }
        }
    }

    /// After the last map: send the chip, then end the run.
    fn finish(&mut self) {
        if self.products.chip.is_some_and(|chip| chip.maps > 0) && !self.chip_sent {
            self.chip_sent = true;
            self.transfer = Transfer::ChipStart;
        } else {
            self.state = State::Done;
            self.due.status = true;
        }
    }
}
