//! Declarations of the used part of UHD's C API, as in `uhd.h` of version 4.3.
//!
//! One list of functions generates both the declarations and [`DECLARED`]. A test compiles the latter in C against the
//! installed header, so that the declarations in use are those checked. All functions return an error code, 0 for
//! success.

use std::ffi::{c_char, c_int, c_uint, c_void};

/// Opaque object of UHD behind a handle.
#[repr(C)]
pub(super) struct Opaque {
    _none: [u8; 0],
}

pub(super) type Error = c_uint;
pub(super) type Usrp = *mut Opaque;
pub(super) type Strings = *mut Opaque;
pub(super) type Span = *mut Opaque;
pub(super) type Subdevice = *mut Opaque;
pub(super) type Sensor = *mut Opaque;
pub(super) type RxStreamer = *mut Opaque;
pub(super) type TxStreamer = *mut Opaque;
pub(super) type RxMetadata = *mut Opaque;
pub(super) type TxMetadata = *mut Opaque;
pub(super) type AsyncMetadata = *mut Opaque;

/// `uhd_stream_args_t`.
#[repr(C)]
pub(super) struct StreamArgs {
    pub(super) cpu_format: *mut c_char,
    pub(super) otw_format: *mut c_char,
    pub(super) args: *mut c_char,
    pub(super) channel_list: *mut usize,
    pub(super) n_channels: c_int,
}

/// `uhd_stream_cmd_t`.
#[repr(C)]
pub(super) struct StreamCommand {
    pub(super) stream_mode: c_uint,
    pub(super) num_samps: usize,
    pub(super) stream_now: bool,
    pub(super) time_spec_full_secs: i64,
    pub(super) time_spec_frac_secs: f64,
}

/// `uhd_tune_request_t`.
#[repr(C)]
pub(super) struct TuneRequest {
    pub(super) target_freq: f64,
    pub(super) rf_freq_policy: c_uint,
    pub(super) rf_freq: f64,
    pub(super) dsp_freq_policy: c_uint,
    pub(super) dsp_freq: f64,
    pub(super) args: *mut c_char,
}

/// `uhd_tune_result_t`.
#[repr(C)]
#[derive(Default)]
pub(super) struct TuneResult {
    pub(super) clipped_rf_freq: f64,
    pub(super) target_rf_freq: f64,
    pub(super) actual_rf_freq: f64,
    pub(super) target_dsp_freq: f64,
    pub(super) actual_dsp_freq: f64,
}

/// `uhd_error`.
pub(super) const ERROR_USB: Error = 21;
pub(super) const ERROR_IO: Error = 30;
pub(super) const ERROR_OS: Error = 31;
/// `uhd_stream_mode_t`.
pub(super) const SAMPLES_AND_DONE: c_uint = 100;
/// `uhd_tune_request_policy_t`.
pub(super) const POLICY_AUTO: c_uint = 65;
/// `uhd_rx_metadata_error_code_t`.
pub(super) const RX_NONE: c_uint = 0;
pub(super) const RX_TIMEOUT: c_uint = 1;
pub(super) const RX_LATE: c_uint = 2;
pub(super) const RX_OVERFLOW: c_uint = 8;
/// `uhd_async_metadata_event_code_t`.
pub(super) const TX_ACK: c_uint = 1;
pub(super) const TX_UNDERFLOW: c_uint = 2;
pub(super) const TX_SEQUENCE: c_uint = 4;
pub(super) const TX_TIME: c_uint = 8;
pub(super) const TX_UNDERFLOW_IN_PACKET: c_uint = 16;
pub(super) const TX_SEQUENCE_IN_BURST: c_uint = 32;

macro_rules! declare {
    ($(fn $name:ident($($argument:ident: $type:ty),* $(,)?);)*) => {
        #[link(name = "uhd")]
        // SAFETY: the declarations match the installed header; tested by the tests of this module.
        unsafe extern "C" {
            $(pub(super) fn $name($($argument: $type),*) -> Error;)*
        }

        /// Names of the functions and types of their arguments.
        #[cfg(test)]
        const DECLARED: &[(&str, &[&str])] = &[$((stringify!($name), &[$(stringify!($type)),*])),*];
    };
}

declare! {
    fn uhd_get_last_error(text: *mut c_char, len: usize);
    fn uhd_get_version_string(text: *mut c_char, len: usize);

    fn uhd_string_vector_make(h: *mut Strings);
    fn uhd_string_vector_free(h: *mut Strings);
    fn uhd_string_vector_size(h: Strings, size: *mut usize);
    fn uhd_string_vector_at(h: Strings, index: usize, text: *mut c_char, len: usize);
    fn uhd_meta_range_make(h: *mut Span);
    fn uhd_meta_range_free(h: *mut Span);
    fn uhd_meta_range_start(h: Span, start: *mut f64);
    fn uhd_meta_range_stop(h: Span, stop: *mut f64);
    fn uhd_subdev_spec_make(h: *mut Subdevice, markup: *const c_char);
    fn uhd_subdev_spec_free(h: *mut Subdevice);
    fn uhd_sensor_value_make(h: *mut Sensor);
    fn uhd_sensor_value_free(h: *mut Sensor);
    fn uhd_sensor_value_to_bool(h: Sensor, value: *mut bool);
    fn uhd_sensor_value_to_realnum(h: Sensor, value: *mut f64);

    fn uhd_usrp_find(args: *const c_char, found: *mut Strings);
    fn uhd_usrp_make(h: *mut Usrp, args: *const c_char);
    fn uhd_usrp_free(h: *mut Usrp);
    fn uhd_usrp_get_mboard_name(h: Usrp, mboard: usize, text: *mut c_char, len: usize);
    fn uhd_usrp_set_clock_source(h: Usrp, source: *const c_char, mboard: usize);
    fn uhd_usrp_set_time_source(h: Usrp, source: *const c_char, mboard: usize);
    fn uhd_usrp_set_time_unknown_pps(h: Usrp, full: i64, frac: f64);
    fn uhd_usrp_get_time_now(h: Usrp, mboard: usize, full: *mut i64, frac: *mut f64);
    fn uhd_usrp_set_command_time(h: Usrp, full: i64, frac: f64, mboard: usize);
    fn uhd_usrp_clear_command_time(h: Usrp, mboard: usize);
    fn uhd_usrp_set_master_clock_rate(h: Usrp, rate: f64, mboard: usize);
    fn uhd_usrp_get_master_clock_rate(h: Usrp, mboard: usize, rate: *mut f64);
    fn uhd_usrp_get_mboard_sensor_names(h: Usrp, mboard: usize, names: *mut Strings);
    fn uhd_usrp_get_mboard_sensor(h: Usrp, name: *const c_char, mboard: usize, value: *mut Sensor);

    fn uhd_usrp_set_rx_subdev_spec(h: Usrp, spec: Subdevice, mboard: usize);
    fn uhd_usrp_set_rx_rate(h: Usrp, rate: f64, channel: usize);
    fn uhd_usrp_get_rx_rate(h: Usrp, channel: usize, rate: *mut f64);
    fn uhd_usrp_set_rx_freq(h: Usrp, request: *mut TuneRequest, channel: usize, result: *mut TuneResult);
    fn uhd_usrp_get_rx_freq(h: Usrp, channel: usize, hz: *mut f64);
    fn uhd_usrp_get_rx_freq_range(h: Usrp, channel: usize, range: Span);
    fn uhd_usrp_set_rx_gain(h: Usrp, gain: f64, channel: usize, name: *const c_char);
    fn uhd_usrp_get_rx_gain(h: Usrp, channel: usize, name: *const c_char, gain: *mut f64);
    fn uhd_usrp_get_rx_gain_range(h: Usrp, name: *const c_char, channel: usize, range: Span);
    fn uhd_usrp_set_rx_antenna(h: Usrp, antenna: *const c_char, channel: usize);
    fn uhd_usrp_get_rx_antennas(h: Usrp, channel: usize, antennas: *mut Strings);
    fn uhd_usrp_set_rx_bandwidth(h: Usrp, hz: f64, channel: usize);
    fn uhd_usrp_get_rx_bandwidth(h: Usrp, channel: usize, hz: *mut f64);
    fn uhd_usrp_get_rx_bandwidth_range(h: Usrp, channel: usize, range: Span);
    fn uhd_usrp_get_rx_sensor_names(h: Usrp, channel: usize, names: *mut Strings);
    fn uhd_usrp_get_rx_sensor(h: Usrp, name: *const c_char, channel: usize, value: *mut Sensor);

    fn uhd_usrp_set_tx_subdev_spec(h: Usrp, spec: Subdevice, mboard: usize);
    fn uhd_usrp_set_tx_rate(h: Usrp, rate: f64, channel: usize);
    fn uhd_usrp_get_tx_rate(h: Usrp, channel: usize, rate: *mut f64);
    fn uhd_usrp_set_tx_freq(h: Usrp, request: *mut TuneRequest, channel: usize, result: *mut TuneResult);
    fn uhd_usrp_get_tx_freq(h: Usrp, channel: usize, hz: *mut f64);
    fn uhd_usrp_set_tx_gain(h: Usrp, gain: f64, channel: usize, name: *const c_char);
    fn uhd_usrp_get_tx_gain(h: Usrp, channel: usize, name: *const c_char, gain: *mut f64);
    fn uhd_usrp_get_tx_gain_range(h: Usrp, name: *const c_char, channel: usize, range: Span);
    fn uhd_usrp_set_tx_antenna(h: Usrp, antenna: *const c_char, channel: usize);
    fn uhd_usrp_get_tx_antennas(h: Usrp, channel: usize, antennas: *mut Strings);
    fn uhd_usrp_set_tx_bandwidth(h: Usrp, hz: f64, channel: usize);
    fn uhd_usrp_get_tx_sensor(h: Usrp, name: *const c_char, channel: usize, value: *mut Sensor);

    fn uhd_rx_streamer_make(h: *mut RxStreamer);
    fn uhd_rx_streamer_free(h: *mut RxStreamer);
    fn uhd_usrp_get_rx_stream(h: Usrp, args: *mut StreamArgs, stream: RxStreamer);
    fn uhd_rx_streamer_max_num_samps(h: RxStreamer, most: *mut usize);
    fn uhd_rx_streamer_issue_stream_cmd(h: RxStreamer, command: *const StreamCommand);
    fn uhd_rx_streamer_recv(
        h: RxStreamer, buffers: *mut *mut c_void, samples: usize, metadata: *mut RxMetadata, timeout: f64,
        one_packet: bool, received: *mut usize,
    );
    fn uhd_rx_metadata_make(h: *mut RxMetadata);
    fn uhd_rx_metadata_free(h: *mut RxMetadata);
    fn uhd_rx_metadata_error_code(h: RxMetadata, code: *mut c_uint);
    fn uhd_rx_metadata_out_of_sequence(h: RxMetadata, is: *mut bool);
    fn uhd_rx_metadata_time_spec(h: RxMetadata, full: *mut i64, frac: *mut f64);

    fn uhd_tx_streamer_make(h: *mut TxStreamer);
    fn uhd_tx_streamer_free(h: *mut TxStreamer);
    fn uhd_usrp_get_tx_stream(h: Usrp, args: *mut StreamArgs, stream: TxStreamer);
    fn uhd_tx_streamer_max_num_samps(h: TxStreamer, most: *mut usize);
    fn uhd_tx_streamer_send(
        h: TxStreamer, buffers: *mut *const c_void, samples: usize, metadata: *mut TxMetadata, timeout: f64,
        sent: *mut usize,
    );
    fn uhd_tx_metadata_make(
        h: *mut TxMetadata, has_time: bool, full: i64, frac: f64, start_of_burst: bool, end_of_burst: bool,
    );
    fn uhd_tx_metadata_free(h: *mut TxMetadata);
    fn uhd_async_metadata_make(h: *mut AsyncMetadata);
    fn uhd_async_metadata_free(h: *mut AsyncMetadata);
    fn uhd_tx_streamer_recv_async_msg(h: TxStreamer, metadata: *mut AsyncMetadata, timeout: f64, valid: *mut bool);
    fn uhd_async_metadata_event_code(h: AsyncMetadata, code: *mut c_uint);
}

#[cfg(test)]
mod tests;
