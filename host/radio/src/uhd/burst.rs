//! A burst: samples sent and received at once, by packets, in one thread.

use std::time::{Duration, Instant};

use num_complex::Complex32;

use super::calls::Usrp;
use super::streams::{Packet, Rx, Said, Tx};
use crate::error::RadioError;
use crate::transceiver::{Burst, Event, EventKind, Received, Sample};

/// How much later than a burst's end its last packet may come, and then its acknowledgement.
const SLACK: Duration = Duration::from_millis(100);
/// Messages of a transmitter that UHD keeps, and more.
const WAITING: usize = 1 << 12;
/// How long one call waits for a packet: short against what a device has to send.
const PACKET_S: f64 = 1e-3;
/// Largest part of 16 bits that 12 bits have: the least that is full scale.
const FULL: u16 = 0x7ff0;

/// Both streamers, and the waveform as often as a packet needs it.
#[derive(Debug)]
pub(super) struct Streams {
    rx: Rx,
    tx: Tx,
    sent: Vec<Complex32>,
}

/// What came of a burst so far.
struct Filled<'a> {
    receive: [&'a mut [Sample]; 2],
    /// Samples before this are there, or lost.
    next: usize,
    first_s: Option<f64>,
    lost: Vec<std::ops::Range<usize>>,
    clipped: [u32; 2],
}

impl Filled<'_> {
    /// Puts a packet where its time says. What is from before the burst, or there already, is left out.
    fn put(&mut self, packet: [&[Sample]; 2], first_s: f64, at_s: f64, rate_hz: f64) {
        let (count, all) = (packet[0].len(), self.receive[0].len());
        // `as` saturates; a time that is no number is 0.
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
        // From wherever in a period a packet begins.
        let whole = burst.waveform.iter().copied().cycle();
        self.sent.extend(whole.take(period + most));
        let mut tell = |kind| {
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
            .map_err(|_| RadioError::Burst(format!("it would end in {ahead_s} s")))?
            .saturating_add(SLACK);
        // What was said of earlier bursts after their time; no more than can be waiting.
        for _ in 0..WAITING {
            match self.tx.said(0.0)? {
                Some(Said::Underflow) => tell(EventKind::Underflow),
                Some(Said::Lost) => tell(EventKind::LostPacket),
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
                    // No room until some of it is sent.
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
                Packet::Overflow => tell(EventKind::Overflow),
                Packet::Lost => tell(EventKind::LostPacket),
            }
        }
        if (1..all).contains(&sent) {
            // Nothing more comes; a burst that does not end is one that the next is a part of.
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
                Some(Said::Underflow) => tell(EventKind::Underflow),
                Some(Said::Lost) => tell(EventKind::LostPacket),
                Some(Said::Other) => {}
            }
        }
        if late {
            tell(EventKind::LateCommand);
            (filled.next, filled.clipped) = (0, [0; 2]);
            filled.lost.clear();
        } else if nothing {
            // A device that is gone says so here.
            usrp.now_s()?;
            tell(EventKind::LostPacket);
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

    /// What is in the buffer after packets of these starts and lengths, of samples that count from 1, and what is lost.
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
            // A third of a sample off, as a device's clock ticks.
            let first_s = 5.0 + (start as f64 + 0.3) / 1e6;
            filled.put([&samples, &samples], first_s, 5.0, 1e6);
        }
        filled.lose_until(10);
        let lost = filled.lost;
        (a.iter().map(|z| z.re).collect(), lost)
    }

    #[test]
    fn samples_go_where_their_times_say() {
        let whole: Vec<i16> = (1..=10).collect();
        assert_eq!(filled(&[(0, 4), (4, 4), (8, 4)]), (whole.clone(), vec![]));
        // From before the burst, twice, after it.
        assert_eq!(
            filled(&[(-7, 4), (-2, 6), (1, 3), (4, 6), (40, 3)]),
            (whole, vec![])
        );
        let gaps = filled(&[(1, 3), (6, 2)]);
        assert_eq!(gaps.0, [0, 2, 3, 4, 0, 0, 7, 8, 0, 0]);
        assert_eq!(gaps.1, [0..1, 4..6, 8..10]);
    }
}
