//! Order of work.

use subaperture_core::link::State;
use subaperture_core::stream::{MapHeader, Progress, Setup};

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
        if self.take_pulse() {
            return true;
        }
        match self.transfer {
            Transfer::Nothing => {}
            Transfer::Products => {
                self.work_on_products();
                return true;
            }
            _ => return false,
        }
        match self.processor.work() {
            Progress::Busy => true,
            Progress::Map => {
                if let Some(map) = self.processor.map()
                    && self.is_whole(&map.header)
                {
                    self.products.begin_map(&map);
                    self.transfer = Transfer::Products;
                }
                true
            }
            Progress::Idle => {
                if self.state == State::Finishing && self.source.is_empty() {
                    self.end_run();
                }
                false
            }
        }
    }

    /// Whether the sub-CPI of a map has all its pulses, or the number of pulses is unknown.
    fn is_whole(&self, header: &MapHeader) -> bool {
        let setup = self.processor.setup();
        let most = setup.map_or(0, Setup::numbers_per_sub_cpi);
        let first = header.sub_cpi.saturating_mul(most);
        let rest = self.total_pulses.saturating_sub(first);
        let has = u32::from(header.num_pulses).saturating_mul(self.channels().into());
        self.total_pulses == 0 || has == rest.min(most)
    }

    /// Do one step of the products of the current map, or start to send the results.
    fn work_on_products(&mut self) {
        self.transfer = Transfer::Nothing;
        let (Some(setup), Some(map)) = (self.processor.setup(), self.processor.map()) else {
            return;
        };
        if self.products.work(setup, &map) {
            self.transfer = Transfer::Products;
            return;
        }
        self.products.end_map(&map.header);
        if map.header.channel.saturating_add(1) < setup.num_channels {
            // The maps of the other channels follow.
            return;
        }
        self.transfer = if self.send_maps {
            Transfer::MapStart
        } else {
            self.maps = self.maps.saturating_add(1);
            self.after_map()
        };
        if self.aborting && !self.products.is_partial() {
            self.end_run();
        }
    }

    /// Transfer after a map: its detections, if requested.
    pub(super) fn after_map(&self) -> Transfer {
        match self.products.cfar {
            Some(_) => Transfer::Detections(0),
            None => Transfer::Nothing,
        }
    }

    /// End the run.
    pub(super) fn end_run(&mut self) {
        self.processor.stop();
        self.source.stop();
        self.transfer = Transfer::Nothing;
        self.aborting = false;
        self.state = State::Done;
        self.due.status = true;
    }
}
