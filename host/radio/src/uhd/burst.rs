//! Burst with a USRP: packets are sent and received concurrently in one thread.

use std::time::{Duration, Instant};

use num_complex::Complex32;

use super::calls::Usrp;
use super::streams::{Packet, Rx, Said, Tx};
use crate::error::RadioError;
use crate::transceiver::{Burst, Event, EventKind, Received, Sample};

/// Largest delay of the last packet after the end of a burst, and then of the acknowledgement.
const SLACK: Duration = Duration::from_millis(100);
/// Maximum number of asynchronous transmit messages read; more than UHD queues.
const WAITING: usize = 1 << 12;
/// Timeout of one receive call, seconds; short compared with the device's transmit buffer.
const PACKET_S: f64 = 1e-3;
/// Magnitude at which a sample counts as full scale: the largest 12-bit value scaled to 16 bits.
const FULL: u16 = 0x7ff0;

/// Both streamers, and the waveform repeated for the length of a packet.
#[derive(Debug)]
pub(super) struct Streams {
    rx: Rx,
    tx: Tx,
    sent: Vec<Complex32>,
}

/// Partially received burst.
struct Filled<'a> {
    receive: [&'a mut [Sample]; 2],
    /// Index up to which samples are received or lost.
    next: usize,
    first_s: Option<f64>,
    lost: Vec<std::ops::Range<usize>>,
    clipped: [u32; 2],
}

impl Filled<'_> {
    /// Store a packet at the position given by its timestamp. Samples before the burst or already received are dropped.
    fn put(&mut self, packet: [&[Sample]; 2], first_s: f64, at_s: f64, rate_hz: f64) {
        let (count, all) = (packet[0].len(), self.receive[0].len());
        // `as` saturates, and converts NaN to 0.
        let start = ((first_s - at_s) * rate_hz).round() as i64;
        let skipped = (self.next as i64).saturating_sub(start).max(0) as usize;
        let from = start.max(self.next as i64) as usize;
        if skipped >= count || from >= all {
            return;
        }
        let length = (count - skipped).min(all - from);
        self.lose_until(from);
        if from == 0 && skipped == 0 {
            self.first_s = Some(first_s);
        }
        for (channel, out) in self.receive.iter_mut().enumerate() {
            let samples = &packet[channel][skipped..skipped + length];
            out[from..from + length].copy_from_slice(samples);
            let full = |x: i16| x.unsigned_abs() >= FULL;
            let clipped = samples.iter().filter(|z| full(z.re) || full(z.im)).count();
            self.clipped[channel] += clipped as u32;
        }
        self.next = from + length;
    }

    fn lose_until(&mut self, end: usize) {
        if end > self.next {
            for channel in &mut self.receive {
                channel[self.next..end].fill(Sample::ZERO);
            }
            self.lost.push(self.next..end);
            self.next = end;
        }
    }
}

impl Streams {
    pub(super) fn new(usrp: &Usrp, wire: &str) -> Result<Self, RadioError> {
        Ok(Self {
            rx: Rx::new(usrp, wire)?,
            tx: Tx::new(usrp, wire)?,
            sent: Vec::new(),
        })
    }

    pub(super) fn burst(
        &mut self,
        usrp: &Usrp,
        burst: &Burst,
        rate_hz: f64,
        receive: [&mut [Sample]; 2],
        events: &mut Vec<Event>,
    ) -> Result<Received, RadioError> {
        let (all, period) = (receive[0].len(), burst.waveform.len());
        let most = self.tx.most();
        self.sent.clear();
        // One period plus a packet, so that a packet can start anywhere in a period.
        let whole = burst.waveform.iter().copied().cycle();
        self.sent.extend(whole.take(period + most));
        let mut report = |kind| {
            events.push(Event {
                kind,
                time_s: Some(burst.at_s),
                count: 1,
            });
        };
        let mut filled = Filled {
            receive,
            next: 0,
            first_s: None,
            lost: Vec::new(),
            clipped: [0; 2],
        };
        let ahead_s = (burst.at_s - usrp.now_s()?).max(0.0) + all as f64 / rate_hz;
        let wait = Duration::try_from_secs_f64(ahead_s)
            .map_err(|_| {
                RadioError::Burst(format!(
                    "the burst would end in {ahead_s} s: expected a shorter burst"
                ))
            })?
            .saturating_add(SLACK);
        // Late messages about earlier bursts; bounded by the size of the queue.
        for _ in 0..WAITING {
            match self.tx.said(0.0)? {
                Some(Said::Underflow) => report(EventKind::Underflow),
                Some(Said::Lost) => report(EventKind::LostPacket),
                Some(_) => {}
                None => break,
            }
        }
        let began = Instant::now();
        self.rx.ask(all, burst.at_s)?;
        let (mut sent, mut late) = (0, false);
        while filled.next < all {
            while sent < all {
                let (offset, count) = (sent % period, most.min(all - sent));
                let first = (sent == 0).then_some(burst.at_s);
                let last = sent + count == all;
                let samples = &self.sent[offset..offset + count];
                match self.tx.send(samples, first, last, 0.0)? {
                    // The device's transmit buffer is full.
                    0 => break,
                    count => sent += count,
                }
            }
            match self.rx.take(PACKET_S)? {
                Packet::Samples { count, first_s } => {
                    let packet = [0, 1].map(|channel| &self.rx.packet(channel)[..count]);
                    filled.put(packet, first_s, burst.at_s, rate_hz);
                }
                Packet::Timeout if began.elapsed() > wait => break,
                Packet::Timeout => {}
                Packet::Late => {
                    late = true;
                    break;
                }
                Packet::Overflow => report(EventKind::Overflow),
                Packet::Lost => report(EventKind::LostPacket),
            }
        }
        if (1..all).contains(&sent) {
            // End the transmission early: an unfinished burst would be continued by the next.
            self.tx.send(&[], None, true, SLACK.as_secs_f64())?;
        }
        let nothing = filled.next == 0 && !late;
        let began = Instant::now();
        while sent > 0 && began.elapsed() < SLACK {
            match self.tx.said(SLACK.as_secs_f64())? {
                Some(Said::Acknowledged) | None => break,
                Some(Said::Late) => {
                    late = true;
                    break;
                }
                Some(Said::Underflow) => report(EventKind::Underflow),
                Some(Said::Lost) => report(EventKind::LostPacket),
                Some(Said::Other) => {}
            }
        }
        if late {
            report(EventKind::LateCommand);
            (filled.next, filled.clipped) = (0, [0; 2]);
            filled.lost.clear();
        } else if nothing {
            // Returns an error if the device is disconnected.
            usrp.now_s()?;
            report(EventKind::LostPacket);
        }
        filled.lose_until(all);
        Ok(Received {
            first_s: filled.first_s.filter(|_| !late).unwrap_or(burst.at_s),
            late,
            lost: filled.lost,
            clipped: filled.clipped,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Buffer and lost ranges after packets with the given starts and lengths; samples count from 1.
    fn filled(packets: &[(i64, usize)]) -> (Vec<i16>, Vec<std::ops::Range<usize>>) {
        let (mut a, mut b) = (vec![Sample::new(-9, -9); 10], vec![Sample::ZERO; 10]);
        let mut filled = Filled {
            receive: [&mut a, &mut b],
            next: 0,
            first_s: None,
            lost: Vec::new(),
            clipped: [0; 2],
        };
        for &(start, length) in packets {
            let samples: Vec<Sample> = (0..length as i64)
                .map(|i| Sample::new((start + i + 1) as i16, 0))
                .collect();
            // Timestamps are off by a third of a sample, as with a device clock.
            let first_s = 5.0 + (start as f64 + 0.3) / 1e6;
            filled.put([&samples, &samples], first_s, 5.0, 1e6);
        }
        filled.lose_until(10);
        let lost = filled.lost;
        (a.iter().map(|z| z.re).collect(), lost)
    }

    #[test]
    fn samples_are_stored_by_timestamp() {
        let whole: Vec<i16> = (1..=10).collect();
        assert_eq!(filled(&[(0, 4), (4, 4), (8, 4)]), (whole.clone(), vec![]));
        // Packets before the burst, repeated, overlapping, and after it.
        assert_eq!(
            filled(&[(-7, 4), (-2, 6), (1, 3), (4, 6), (40, 3)]),
            (whole, vec![])
        );
        let gaps = filled(&[(1, 3), (6, 2)]);
        assert_eq!(gaps.0, [0, 2, 3, 4, 0, 0, 7, 8, 0, 0]);
        assert_eq!(gaps.1, [0..1, 4..6, 8..10]);
    }
}
