//! Reports to the host, one frame at a time.

use subaperture_core::link::{
    self, Encoder, MAX_LIST_BYTES, Report, State, Status, TransferChecksum, detection_bytes,
    write_detections, write_map_row,
};

use super::module::Module;
use super::transfer::Transfer;
use crate::engine::WireEngine;

impl<E: WireEngine> Module<'_, E> {
    /// Encode the next frame to send, if any, into the buffer.
    pub(super) fn next_frame(&mut self, link: link::LinkCounters) {
        self.pending = (0, 0);
        if self.due.identity {
            self.due.identity = false;
            let report = Report::Identity {
                protocol: link::PROTOCOL_VERSION,
                arithmetic: E::ARITHMETIC,
                capacity: *self.processor.capacity(),
                image: self.products.capacity(),
                version: self.version,
            };
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        if let Some((sequence, what)) = self.due.refusal.take() {
            let report = Report::Refused { sequence, what };
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        if let Some(step) = self.increments.take_due() {
            // The increment implies the credit for the next pulse.
            self.reported_credit = self.increments.accept_through();
            self.pending = send(
                &mut self.encoder,
                self.frame,
                &Report::Increment((&step).into()),
            );
            return;
        }
        let increments = self.increments.is_configured();
        let (next_pulse, credit, pulses) = if increments {
            let own = &self.increments;
            (own.next_pulse(), own.accept_through(), own.counters())
        } else if self.profiles.is_configured() {
            // There is no credit: samples are processed on arrival.
            let own = &self.profiles;
            (own.next_sweep(), u32::MAX, own.counters())
        } else {
            let own = &self.processor;
            let (next_pulse, credit) = self.source.flow(own.next_pulse(), own.accept_through());
            (next_pulse, credit, own.counters())
        };
        let more_credit = self.state == State::Running && credit != self.reported_credit;
        if self.due.status || more_credit {
            let status = Status {
                state: self.state,
                configuration: self.configuration,
                run: self.run.unwrap_or(0),
                next_pulse,
                accept_through: credit,
                maps: self.maps,
                link,
                pulses,
            };
            self.events.compare(&status);
            // The host may leave after the status that ends a run.
            let done = self.state == State::Done;
            let report = match done.then(|| self.events.next()).flatten() {
                Some(event) => Report::Event(event),
                None => {
                    self.due.status = false;
                    self.reported_credit = credit;
                    Report::Status(status)
                }
            };
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        if let Some(first) = self.due.accumulated.take() {
            let bits = self.products.accumulated(first);
            let report = Report::Accumulated { first, bits };
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        if let Some(event) = self.events.next() {
            self.pending = send(&mut self.encoder, self.frame, &Report::Event(event));
            return;
        }
        self.next_part();
    }

    /// Encode the next part of the transfer in progress into the buffer.
    fn next_part(&mut self) {
        let transfer = core::mem::replace(&mut self.transfer, Transfer::Nothing);
        self.transfer = match transfer {
            Transfer::Nothing => Transfer::Nothing,
            Transfer::Products => Transfer::Products,
            Transfer::MapStart | Transfer::MapRow { .. } | Transfer::MapEnd { .. } => {
                self.next_of_map(transfer)
            }
            Transfer::Detections(first) => self.next_detections(first),
            Transfer::ChipStart | Transfer::ChipPart { .. } | Transfer::ChipEnd { .. } => {
                self.next_of_chip(transfer)
            }
            Transfer::ProfileStart | Transfer::ProfileRow { .. } | Transfer::ProfileEnd { .. } => {
                self.next_of_profile(transfer)
            }
        };
    }

    fn next_of_map(&mut self, transfer: Transfer) -> Transfer {
        let Some(map) = self.processor.map() else {
            return Transfer::Nothing;
        };
        let (number, rows) = (self.maps, map.header.patch.num_doppler_bins() as u16);
        match transfer {
            Transfer::MapRow { row, mut checksum } => {
                // A row that exceeds the buffer is left out; the end of the map will then not match.
                if let Some(samples) = write_map_row(&map, row.into(), self.row) {
                    checksum.add_row(samples);
                    let report = Report::MapRow {
                        map: number,
                        row,
                        samples,
                    };
                    self.pending = send(&mut self.encoder, self.frame, &report);
                }
                match row.wrapping_add(1) {
                    row if row < rows => Transfer::MapRow { row, checksum },
                    _ => Transfer::MapEnd { checksum },
                }
            }
            Transfer::MapEnd { checksum } => {
                let report = Report::MapEnd {
                    map: number,
                    rows,
                    crc: checksum.value(),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                self.maps = self.maps.saturating_add(1);
                self.after_map()
            }
            _ => {
                let report = Report::MapStart {
                    map: number,
                    header: map.header,
                    encoding: E::MAP_ENCODING,
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                let checksum = TransferChecksum::new(&map.header);
                Transfer::MapRow { row: 0, checksum }
            }
        }
    }

    /// An empty list is sent as one frame, so that the host knows that nothing was detected.
    fn next_detections(&mut self, first: usize) -> Transfer {
        let Some(map) = self.processor.map() else {
            return Transfer::Nothing;
        };
        let (all, channels) = (&self.products.detections, self.channels());
        let rest = all.get(first..).unwrap_or(&[]);
        let values = self.products.values().get(first..).unwrap_or(&[]);
        // A short row buffer holds fewer detections.
        let bytes = MAX_LIST_BYTES.min(self.row.len());
        let most = (bytes / detection_bytes(channels.into())).max(1);
        let now = rest.get(..most).unwrap_or(rest);
        if let Some(list) = write_detections(now, values, channels.into(), self.row) {
            let report = Report::Detections {
                map: self.maps.saturating_sub(1),
                sub_cpi: map.header.sub_cpi,
                patch: map.header.patch_index,
                first: first as u16,
                total: all.len() as u16,
                channels,
                list,
            };
            self.pending = send(&mut self.encoder, self.frame, &report);
        }
        match first.saturating_add(most) {
            next if next < all.len() => Transfer::Detections(next),
            _ => Transfer::Nothing,
        }
    }

    fn next_of_chip(&mut self, transfer: Transfer) -> Transfer {
        let chips = self.products.chips();
        let Some(chip) = chips.get(usize::from(self.chip)) else {
            return Transfer::Nothing;
        };
        let number = self.chips_requested.wrapping_sub(1);
        let parts = chip.num_parts();
        match transfer {
            Transfer::ChipPart { part, mut checksum } => {
                let products = &self.products;
                let encoding = products.chip_encoding(E::MAP_ENCODING);
                if let Some(samples) = products.chip_part(chip, part, encoding, self.row) {
                    checksum.add_row(samples);
                    let report = Report::ChipPart {
                        chip: number,
                        part,
                        samples,
                    };
                    self.pending = send(&mut self.encoder, self.frame, &report);
                }
                match part.wrapping_add(1) {
                    part if part < parts => Transfer::ChipPart { part, checksum },
                    _ => Transfer::ChipEnd { checksum },
                }
            }
            Transfer::ChipEnd { checksum } => {
                let report = Report::ChipEnd {
                    chip: number,
                    parts,
                    crc: checksum.value(),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                Transfer::Nothing
            }
            _ => {
                let report = Report::ChipStart {
                    chip: number,
                    grid: chip.grid,
                    maps: self.products.sub_cpis,
                    weight_sum: self.products.weight_sum,
                    left_out: chip.left_out,
                    encoding: self.products.chip_encoding(E::MAP_ENCODING),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                let checksum = TransferChecksum::new(&chip.grid);
                Transfer::ChipPart { part: 0, checksum }
            }
        }
    }
}

/// Encode a frame into the buffer and return the range of its bytes.
pub(super) fn send(
    encoder: &mut Encoder,
    buffer: &mut [u8],
    report: &Report<'_>,
) -> (usize, usize) {
    // If the buffer is too small the report is not sent: the host repeats the request or counts a map as lost.
    (0, encoder.encode(report, buffer).map_or(0, <[u8]>::len))
}
