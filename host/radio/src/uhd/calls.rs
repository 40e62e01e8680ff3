//! Safe wrappers of UHD's C API: owning handles, strings, numbers, and errors with UHD's message.
//!
//! Every handle is created by UHD and freed once, on drop. No raw pointer leaves this module.

use std::ffi::{CStr, c_char};
use std::ptr::null_mut;

use super::errors::{driver_error, name};
use super::ffi;
use crate::error::RadioError;
use crate::transceiver::Range;

/// Buffer size for UHD's texts; longer advice is truncated.
const TEXT: usize = 4096;

/// Motherboard index; a USRP B210 has one.
const BOARD: usize = 0;

/// UHD's last error message.
fn last_error() -> String {
    let mut text = [0u8; TEXT];
    // SAFETY: UHD writes at most the number of bytes passed, into a buffer of that length.
    let code = unsafe { ffi::uhd_get_last_error(text.as_mut_ptr().cast::<c_char>(), text.len()) };
    match code {
        0 => until_zero(&text),
        code => format!("no message available, error {code}"),
    }
}

fn until_zero(text: &[u8]) -> String {
    let end = text.iter().position(|&c| c == 0).unwrap_or(text.len());
    String::from_utf8_lossy(&text[..end]).trim().to_owned()
}

/// Convert an error code into a result.
pub(super) fn done(call: &str, code: ffi::Error) -> Result<(), RadioError> {
    match code {
        0 => Ok(()),
        code => Err(driver_error(call, code, &last_error())),
    }
}

/// Call a function of UHD and convert its error code.
macro_rules! call {
    ($function:ident($($argument:expr),* $(,)?)) => {
        // SAFETY: handles were created by UHD and are not freed before their owner is dropped; all other pointers refer
        // to locals of the declared types that outlive the call; texts are null-terminated or passed with their length.
        done(stringify!($function), unsafe { ffi::$function($($argument),*) })
    };
}
pub(super) use call;

/// Version of UHD, for example `4.6.0.0`.
pub(super) fn version() -> Result<String, RadioError> {
    let mut text = [0u8; TEXT];
    call!(uhd_get_version_string(text.as_mut_ptr().cast(), text.len()))?;
    Ok(until_zero(&text))
}

/// Split a time into whole and fractional seconds, as UHD takes it; exact, since the fraction of a float is a float.
pub(super) fn split(time_s: f64) -> (i64, f64) {
    let full = time_s.floor();
    (full as i64, time_s - full)
}

pub(super) fn joined(full: i64, frac: f64) -> f64 {
    full as f64 + frac
}

/// Owning handle of an object that UHD creates and frees.
macro_rules! handle {
    ($(#[$doc:meta])* $name:ident, $raw:ident, $free:ident) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub(super) struct $name(pub(super) ffi::$raw);

        impl Drop for $name {
            fn drop(&mut self) {
                // SAFETY: created by UHD, and freed only here. An error on freeing cannot be handled.
                unsafe { ffi::$free(&mut self.0) };
            }
        }

        // SAFETY: UHD's objects are not bound to the thread that created them, and each is used through one owner at a
        // time.
        unsafe impl Send for $name {}
    };
}

handle!(
    /// List of strings.
    Strings, Strings, uhd_string_vector_free
);
handle!(Span, Span, uhd_meta_range_free);
handle!(Subdevice, Subdevice, uhd_subdev_spec_free);
handle!(Sensor, Sensor, uhd_sensor_value_free);
handle!(
    /// USRP device.
    Usrp, Usrp, uhd_usrp_free
);
handle!(RxStreamer, RxStreamer, uhd_rx_streamer_free);
handle!(RxMetadata, RxMetadata, uhd_rx_metadata_free);
handle!(TxStreamer, TxStreamer, uhd_tx_streamer_free);
handle!(TxMetadata, TxMetadata, uhd_tx_metadata_free);
handle!(AsyncMetadata, AsyncMetadata, uhd_async_metadata_free);

impl Strings {
    fn new() -> Result<Self, RadioError> {
        let mut made = null_mut();
        call!(uhd_string_vector_make(&mut made))?;
        Ok(Self(made))
    }

    fn read(&self) -> Result<Vec<String>, RadioError> {
        let mut count = 0;
        call!(uhd_string_vector_size(self.0, &mut count))?;
        (0..count)
            .map(|index| {
                let mut text = [0u8; TEXT];
                call!(uhd_string_vector_at(
                    self.0,
                    index,
                    text.as_mut_ptr().cast(),
                    text.len()
                ))?;
                Ok(until_zero(&text))
            })
            .collect()
    }
}

/// Addresses of the devices that match the arguments, in UHD's notation.
pub(super) fn find(args: &str) -> Result<Vec<String>, RadioError> {
    let (args, mut found) = (name(args)?, Strings::new()?);
    call!(uhd_usrp_find(args.as_ptr(), &mut found.0))?;
    found.read()
}

/// Transmit port, or receive port by channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Port {
    Tx,
    Rx(usize),
}

impl Usrp {
    pub(super) fn make(args: &str) -> Result<Self, RadioError> {
        let (args, mut made) = (name(args)?, null_mut());
        call!(uhd_usrp_make(&mut made, args.as_ptr()))?;
        Ok(Self(made))
    }

    pub(super) fn board_name(&self) -> Result<String, RadioError> {
        let mut text = [0u8; TEXT];
        call!(uhd_usrp_get_mboard_name(
            self.0,
            BOARD,
            text.as_mut_ptr().cast(),
            text.len()
        ))?;
        Ok(until_zero(&text))
    }

    pub(super) fn set_sources(&self, clock: &str, pps: &str) -> Result<(), RadioError> {
        let (clock, pps) = (name(clock)?, name(pps)?);
        call!(uhd_usrp_set_clock_source(self.0, clock.as_ptr(), BOARD))?;
        call!(uhd_usrp_set_time_source(self.0, pps.as_ptr(), BOARD))
    }

    /// Set the device time to zero at the next pulse per second; takes up to two seconds.
    pub(super) fn zero_time_at_pps(&self) -> Result<(), RadioError> {
        call!(uhd_usrp_set_time_unknown_pps(self.0, 0, 0.0))
    }

    pub(super) fn now_s(&self) -> Result<f64, RadioError> {
        let (mut full, mut frac) = (0, 0.0);
        call!(uhd_usrp_get_time_now(self.0, BOARD, &mut full, &mut frac))?;
        Ok(joined(full, frac))
    }

    /// Schedule the following commands for a device time; `None` executes them immediately.
    pub(super) fn command_time(&self, at_s: Option<f64>) -> Result<(), RadioError> {
        match at_s.map(split) {
            Some((full, frac)) => call!(uhd_usrp_set_command_time(self.0, full, frac, BOARD)),
            None => call!(uhd_usrp_clear_command_time(self.0, BOARD)),
        }
    }

    pub(super) fn set_subdevices(&self, tx: &str, rx: &str) -> Result<(), RadioError> {
        let spec = |markup: &str| {
            let (markup, mut made) = (name(markup)?, null_mut());
            call!(uhd_subdev_spec_make(&mut made, markup.as_ptr()))?;
            Ok::<_, RadioError>(Subdevice(made))
        };
        let (tx, rx) = (spec(tx)?, spec(rx)?);
        call!(uhd_usrp_set_tx_subdev_spec(self.0, tx.0, BOARD))?;
        call!(uhd_usrp_set_rx_subdev_spec(self.0, rx.0, BOARD))
    }

    pub(super) fn set_master_clock_hz(&self, hz: f64) -> Result<f64, RadioError> {
        call!(uhd_usrp_set_master_clock_rate(self.0, hz, BOARD))?;
        let mut set = 0.0;
        call!(uhd_usrp_get_master_clock_rate(self.0, BOARD, &mut set))?;
        Ok(set)
    }

    pub(super) fn set_rate_hz(&self, port: Port, hz: f64) -> Result<f64, RadioError> {
        let mut set = 0.0;
        match port {
            Port::Tx => {
                call!(uhd_usrp_set_tx_rate(self.0, hz, 0))?;
                call!(uhd_usrp_get_tx_rate(self.0, 0, &mut set))?;
            }
            Port::Rx(channel) => {
                call!(uhd_usrp_set_rx_rate(self.0, hz, channel))?;
                call!(uhd_usrp_get_rx_rate(self.0, channel, &mut set))?;
            }
        }
        Ok(set)
    }

    /// Set the bandwidths and return that of the receivers; UHD's C API cannot read back the transmitter's.
    pub(super) fn set_bandwidth_hz(&self, hz: f64) -> Result<f64, RadioError> {
        call!(uhd_usrp_set_tx_bandwidth(self.0, hz, 0))?;
        call!(uhd_usrp_set_rx_bandwidth(self.0, hz, 0))?;
        call!(uhd_usrp_set_rx_bandwidth(self.0, hz, 1))?;
        let mut set = 0.0;
        call!(uhd_usrp_get_rx_bandwidth(self.0, 0, &mut set))?;
        Ok(set)
    }

    pub(super) fn set_gain_db(&self, port: Port, db: f64) -> Result<f64, RadioError> {
        // All gain stages of the channel.
        let (all, mut set) = (c"".as_ptr(), 0.0);
        match port {
            Port::Tx => {
                call!(uhd_usrp_set_tx_gain(self.0, db, 0, all))?;
                call!(uhd_usrp_get_tx_gain(self.0, 0, all, &mut set))?;
            }
            Port::Rx(channel) => {
                call!(uhd_usrp_set_rx_gain(self.0, db, channel, all))?;
                call!(uhd_usrp_get_rx_gain(self.0, channel, all, &mut set))?;
            }
        }
        Ok(set)
    }

    pub(super) fn set_antenna(&self, port: Port, antenna: &str) -> Result<(), RadioError> {
        let antenna = name(antenna)?;
        match port {
            Port::Tx => call!(uhd_usrp_set_tx_antenna(self.0, antenna.as_ptr(), 0)),
            Port::Rx(channel) => call!(uhd_usrp_set_rx_antenna(self.0, antenna.as_ptr(), channel)),
        }
    }

    /// Tune a port and return the carrier in effect, LO and DSP tuning combined.
    pub(super) fn tune_hz(&self, port: Port, hz: f64) -> Result<f64, RadioError> {
        let mut request = ffi::TuneRequest {
            target_freq: hz,
            rf_freq_policy: ffi::POLICY_AUTO,
            rf_freq: 0.0,
            dsp_freq_policy: ffi::POLICY_AUTO,
            dsp_freq: 0.0,
            // UHD only reads this string.
            args: c"".as_ptr().cast_mut(),
        };
        let (mut result, mut set) = (ffi::TuneResult::default(), 0.0);
        match port {
            Port::Tx => {
                call!(uhd_usrp_set_tx_freq(self.0, &mut request, 0, &mut result))?;
                call!(uhd_usrp_get_tx_freq(self.0, 0, &mut set))?;
            }
            Port::Rx(channel) => {
                call!(uhd_usrp_set_rx_freq(
                    self.0,
                    &mut request,
                    channel,
                    &mut result
                ))?;
                call!(uhd_usrp_get_rx_freq(self.0, channel, &mut set))?;
            }
        }
        Ok(set)
    }

    pub(super) fn carriers_hz(&self) -> Result<Range, RadioError> {
        range(|span| call!(uhd_usrp_get_rx_freq_range(self.0, 0, span)))
    }

    pub(super) fn bandwidths_hz(&self) -> Result<Range, RadioError> {
        range(|span| call!(uhd_usrp_get_rx_bandwidth_range(self.0, 0, span)))
    }

    pub(super) fn transmit_gains_db(&self) -> Result<Range, RadioError> {
        let all = c"".as_ptr();
        range(|span| call!(uhd_usrp_get_tx_gain_range(self.0, all, 0, span)))
    }

    pub(super) fn receive_gains_db(&self) -> Result<Range, RadioError> {
        let all = c"".as_ptr();
        range(|span| call!(uhd_usrp_get_rx_gain_range(self.0, all, 0, span)))
    }

    pub(super) fn antennas(&self, port: Port) -> Result<Vec<String>, RadioError> {
        let mut names = Strings::new()?;
        match port {
            Port::Tx => call!(uhd_usrp_get_tx_antennas(self.0, 0, &mut names.0))?,
            Port::Rx(channel) => call!(uhd_usrp_get_rx_antennas(self.0, channel, &mut names.0))?,
        }
        names.read()
    }

    pub(super) fn receive_sensors(&self) -> Result<Vec<String>, RadioError> {
        let mut names = Strings::new()?;
        call!(uhd_usrp_get_rx_sensor_names(self.0, 0, &mut names.0))?;
        names.read()
    }

    pub(super) fn locked(&self, port: Port) -> Result<bool, RadioError> {
        let (name, mut value) = (c"lo_locked".as_ptr(), Sensor::new()?);
        match port {
            Port::Tx => call!(uhd_usrp_get_tx_sensor(self.0, name, 0, &mut value.0))?,
            Port::Rx(channel) => {
                call!(uhd_usrp_get_rx_sensor(self.0, name, channel, &mut value.0))?
            }
        }
        value.is_true()
    }

    pub(super) fn board_sensors(&self) -> Result<Vec<String>, RadioError> {
        let mut names = Strings::new()?;
        call!(uhd_usrp_get_mboard_sensor_names(
            self.0,
            BOARD,
            &mut names.0
        ))?;
        names.read()
    }

    pub(super) fn reference_locked(&self) -> Result<bool, RadioError> {
        self.is_on_board(c"ref_locked")
    }

    /// Lock of a GPS-disciplined oscillator; waits for its message.
    pub(super) fn gps_locked(&self) -> Result<bool, RadioError> {
        self.is_on_board(c"gps_locked")
    }

    fn is_on_board(&self, name: &CStr) -> Result<bool, RadioError> {
        let mut value = Sensor::new()?;
        call!(uhd_usrp_get_mboard_sensor(
            self.0,
            name.as_ptr(),
            BOARD,
            &mut value.0
        ))?;
        value.is_true()
    }

    pub(super) fn temperature_c(&self) -> Result<f64, RadioError> {
        let (mut value, mut celsius) = (Sensor::new()?, 0.0);
        call!(uhd_usrp_get_rx_sensor(
            self.0,
            c"temp".as_ptr(),
            0,
            &mut value.0
        ))?;
        call!(uhd_sensor_value_to_realnum(value.0, &mut celsius))?;
        Ok(celsius)
    }
}

impl Sensor {
    fn new() -> Result<Self, RadioError> {
        let mut made = null_mut();
        call!(uhd_sensor_value_make(&mut made))?;
        Ok(Self(made))
    }

    fn is_true(&self) -> Result<bool, RadioError> {
        let mut is = false;
        call!(uhd_sensor_value_to_bool(self.0, &mut is))?;
        Ok(is)
    }
}

fn range(read: impl FnOnce(ffi::Span) -> Result<(), RadioError>) -> Result<Range, RadioError> {
    let mut made = null_mut();
    call!(uhd_meta_range_make(&mut made))?;
    let span = Span(made);
    read(span.0)?;
    let (mut from, mut to) = (0.0, 0.0);
    call!(uhd_meta_range_start(span.0, &mut from))?;
    call!(uhd_meta_range_stop(span.0, &mut to))?;
    Ok(Range { from, to })
}
