//! Streamers: timestamped sample packets in both directions, and asynchronous messages.

use std::ffi::{c_int, c_uint, c_void};
use std::ptr::null_mut;

use num_complex::Complex32;

use super::calls::{
    AsyncMetadata, RxMetadata, RxStreamer, TxMetadata, TxStreamer, Usrp, call, done, joined, split,
};
use super::errors::name;
use super::ffi;
use crate::error::RadioError;
use crate::transceiver::Sample;

/// Result of a receive call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Packet {
    /// Number of samples per channel, and device time of the first.
    Samples { count: usize, first_s: f64 },
    /// Nothing arrived within the timeout.
    Timeout,
    /// The command's time had passed.
    Late,
    /// Overrun of the device's buffers.
    Overflow,
    /// A packet was lost, misaligned or broken.
    Lost,
}

/// Asynchronous message of the transmitter about a burst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Said {
    Acknowledged,
    Underflow,
    Lost,
    Late,
    Other,
}

/// Call `make` with streamer arguments: host and wire formats, channels.
fn with_args<T>(
    [cpu, wire]: [&str; 2],
    channels: &mut [usize],
    make: impl FnOnce(&mut ffi::StreamArgs) -> T,
) -> Result<T, RadioError> {
    // UHD only reads these.
    let (cpu, wire) = (name(cpu)?, name(wire)?);
    let mut args = ffi::StreamArgs {
        cpu_format: cpu.as_ptr().cast_mut(),
        otw_format: wire.as_ptr().cast_mut(),
        args: c"".as_ptr().cast_mut(),
        channel_list: channels.as_mut_ptr(),
        n_channels: channels.len() as c_int,
    };
    Ok(make(&mut args))
}

/// Streamer of both receivers.
#[derive(Debug)]
pub(super) struct Rx {
    // Dropped in this order; the metadata do not need the streamer.
    metadata: RxMetadata,
    streamer: RxStreamer,
    /// Packet buffer of each channel.
    packet: [Vec<Sample>; 2],
}

impl Rx {
    pub(super) fn new(usrp: &Usrp, wire: &str) -> Result<Self, RadioError> {
        let (mut made, mut metadata, mut most) = (null_mut(), null_mut(), 0);
        call!(uhd_rx_streamer_make(&mut made))?;
        let streamer = RxStreamer(made);
        with_args(["sc16", wire], &mut [0, 1], |args| {
            call!(uhd_usrp_get_rx_stream(usrp.0, args, streamer.0))
        })??;
        call!(uhd_rx_metadata_make(&mut metadata))?;
        let metadata = RxMetadata(metadata);
        call!(uhd_rx_streamer_max_num_samps(streamer.0, &mut most))?;
        let packet = || vec![Sample::ZERO; most.max(1)];
        Ok(Self {
            metadata,
            streamer,
            packet: [packet(), packet()],
        })
    }

    /// Command the reception of `samples` samples of both channels, starting at device time `at_s`.
    pub(super) fn ask(&self, samples: usize, at_s: f64) -> Result<(), RadioError> {
        let (full, frac) = split(at_s);
        let command = ffi::StreamCommand {
            stream_mode: ffi::SAMPLES_AND_DONE,
            num_samps: samples,
            // Two channels start together only with a start time.
            stream_now: false,
            time_spec_full_secs: full,
            time_spec_frac_secs: frac,
        };
        call!(uhd_rx_streamer_issue_stream_cmd(self.streamer.0, &command))
    }

    /// Receive a packet into [`Self::packet`].
    pub(super) fn take(&mut self, timeout_s: f64) -> Result<Packet, RadioError> {
        let [a, b] = &mut self.packet;
        let most = a.len();
        let mut buffers: [*mut c_void; 2] = [a.as_mut_ptr().cast(), b.as_mut_ptr().cast()];
        let mut count = 0;
        // A sample is two 16-bit numbers, real part first, as in sc16; both buffers have the stated length.
        call!(uhd_rx_streamer_recv(
            self.streamer.0,
            buffers.as_mut_ptr(),
            most,
            &mut self.metadata.0,
            timeout_s,
            true,
            &mut count,
        ))?;
        let mut code: c_uint = 0;
        call!(uhd_rx_metadata_error_code(self.metadata.0, &mut code))?;
        Ok(match code {
            ffi::RX_NONE => {
                let (mut full, mut frac) = (0, 0.0);
                call!(uhd_rx_metadata_time_spec(
                    self.metadata.0,
                    &mut full,
                    &mut frac
                ))?;
                Packet::Samples {
                    count: count.min(most),
                    first_s: joined(full, frac),
                }
            }
            ffi::RX_TIMEOUT => Packet::Timeout,
            ffi::RX_LATE => Packet::Late,
            ffi::RX_OVERFLOW => {
                let mut lost = false;
                call!(uhd_rx_metadata_out_of_sequence(self.metadata.0, &mut lost))?;
                match lost {
                    true => Packet::Lost,
                    false => Packet::Overflow,
                }
            }
            _ => Packet::Lost,
        })
    }

    /// Buffer of a channel: its latest packet, followed by older content.
    pub(super) fn packet(&self, channel: usize) -> &[Sample] {
        &self.packet[channel]
    }
}

/// Streamer of the transmitter.
#[derive(Debug)]
pub(super) struct Tx {
    events: AsyncMetadata,
    streamer: TxStreamer,
    most: usize,
}

impl Tx {
    pub(super) fn new(usrp: &Usrp, wire: &str) -> Result<Self, RadioError> {
        let (mut made, mut events, mut most) = (null_mut(), null_mut(), 0);
        call!(uhd_tx_streamer_make(&mut made))?;
        let streamer = TxStreamer(made);
        // UHD rounds to the wire format.
        with_args(["fc32", wire], &mut [0], |args| {
            call!(uhd_usrp_get_tx_stream(usrp.0, args, streamer.0))
        })??;
        call!(uhd_async_metadata_make(&mut events))?;
        let events = AsyncMetadata(events);
        call!(uhd_tx_streamer_max_num_samps(streamer.0, &mut most))?;
        Ok(Self {
            events,
            streamer,
            most: most.max(1),
        })
    }

    /// Maximum number of samples per packet.
    pub(super) fn most(&self) -> usize {
        self.most
    }

    /// Send up to one packet within the timeout, and return the number of samples sent. `at_s` is the start time, given
    /// with the first packet of a burst.
    pub(super) fn send(
        &self,
        samples: &[Complex32],
        at_s: Option<f64>,
        last: bool,
        timeout_s: f64,
    ) -> Result<usize, RadioError> {
        let (full, frac) = at_s.map_or((0, 0.0), split);
        let (mut made, mut sent) = (null_mut(), 0);
        call!(uhd_tx_metadata_make(
            &mut made,
            at_s.is_some(),
            full,
            frac,
            at_s.is_some(),
            last
        ))?;
        let mut metadata = TxMetadata(made);
        let mut buffers: [*const c_void; 1] = [samples.as_ptr().cast()];
        // A sample is two float32, real part first, as in fc32.
        call!(uhd_tx_streamer_send(
            self.streamer.0,
            buffers.as_mut_ptr(),
            samples.len(),
            &mut metadata.0,
            timeout_s,
            &mut sent,
        ))?;
        Ok(sent.min(samples.len()))
    }

    /// Next asynchronous message of the transmitter, within the timeout.
    pub(super) fn said(&mut self, timeout_s: f64) -> Result<Option<Said>, RadioError> {
        let (mut valid, mut code) = (false, 0);
        call!(uhd_tx_streamer_recv_async_msg(
            self.streamer.0,
            &mut self.events.0,
            timeout_s,
            &mut valid
        ))?;
        if !valid {
            return Ok(None);
        }
        call!(uhd_async_metadata_event_code(self.events.0, &mut code))?;
        Ok(Some(match code {
            ffi::TX_ACK => Said::Acknowledged,
            ffi::TX_UNDERFLOW | ffi::TX_UNDERFLOW_IN_PACKET => Said::Underflow,
            ffi::TX_SEQUENCE | ffi::TX_SEQUENCE_IN_BURST => Said::Lost,
            ffi::TX_TIME => Said::Late,
            _ => Said::Other,
        }))
    }
}
