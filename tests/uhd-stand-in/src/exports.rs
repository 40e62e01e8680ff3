//! Functions of `uhd.h`.

use std::ffi::{CStr, c_char, c_int, c_uint};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use num_complex::Complex32;
use subaperture_radio::{Range, Sample};

use crate::device::{Device, ERROR_INDEX, ERROR_RUNTIME, Fault, PACKET, Waiting, wrong};
use crate::scene;

/// Whether the device has a GPS-disciplined oscillator: `gpsdo` in the variable of faults.
fn has_gpsdo() -> bool {
    std::env::var(scene::FAULTS).is_ok_and(|word| word == "gpsdo")
}

type Shared = Arc<Mutex<Device>>;
type Streamer = Option<Shared>;

/// Text of the last error.
static LAST: Mutex<String> = Mutex::new(String::new());

#[derive(Default)]
struct RxMetadata {
    code: c_uint,
    out_of_sequence: bool,
    time_s: f64,
}

struct TxMetadata {
    at_s: Option<f64>,
    last: bool,
}

#[repr(C)]
struct StreamArgs {
    cpu_format: *const c_char,
    otw_format: *const c_char,
    args: *const c_char,
    channel_list: *const usize,
    n_channels: c_int,
}

#[repr(C)]
struct StreamCommand {
    stream_mode: c_uint,
    num_samps: usize,
    stream_now: bool,
    full: i64,
    frac: f64,
}

#[repr(C)]
struct TuneRequest {
    target_hz: f64,
    rf_policy: c_uint,
    rf_hz: f64,
    dsp_policy: c_uint,
    dsp_hz: f64,
    args: *const c_char,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn answer(result: Result<(), Fault>) -> c_uint {
    match result {
        Ok(()) => 0,
        Err((code, text)) => {
            *lock(&LAST) = text;
            code
        }
    }
}

/// Errors that are always returned.
fn refuse(fault: Fault) -> Result<(), Fault> {
    Err(fault)
}

unsafe fn at<'a, T>(pointer: *mut T) -> Result<&'a mut T, Fault> {
    // SAFETY: as the header says, null or of the type declared.
    unsafe { pointer.as_mut() }.ok_or_else(|| wrong("a null pointer"))
}

unsafe fn text<'a>(pointer: *const c_char) -> Result<&'a str, Fault> {
    if pointer.is_null() {
        return Err(wrong("a null text"));
    }
    // SAFETY: texts end in zero.
    unsafe { CStr::from_ptr(pointer) }
        .to_str()
        .map_err(|_| wrong("expected a text in UTF-8"))
}

unsafe fn put(value: &str, out: *mut c_char, len: usize) -> Result<(), Fault> {
    // SAFETY: the caller states the length.
    let out = unsafe { std::slice::from_raw_parts_mut(at(out)?, len) };
    // Truncated like `strncpy`, which may omit the zero.
    let bytes = value.bytes().chain(std::iter::repeat(0));
    for (c, byte) in out.iter_mut().zip(bytes) {
        *c = byte as c_char;
    }
    Ok(())
}

unsafe fn make<T>(out: *mut *mut T, value: T) -> Result<(), Fault> {
    // SAFETY: of the caller's.
    *unsafe { at(out) }? = Box::into_raw(Box::new(value));
    Ok(())
}

unsafe fn free<T>(out: *mut *mut T) -> Result<(), Fault> {
    // SAFETY: made by `make` as the same type, and freed once, as the header asks for.
    unsafe {
        let handle = at(out)?;
        drop(Box::from_raw(at(*handle)?));
        *handle = std::ptr::null_mut();
    }
    Ok(())
}

unsafe fn device<'a>(h: *mut Shared) -> Result<MutexGuard<'a, Device>, Fault> {
    // SAFETY: a device lives until it is freed.
    unsafe { at(h) }.map(|shared| lock(shared))
}

unsafe fn stream<'a>(h: *mut Streamer) -> Result<MutexGuard<'a, Device>, Fault> {
    // SAFETY: so does a streamer.
    let streamer = unsafe { at(h) }?;
    streamer
        .as_ref()
        .map(|shared| lock(shared))
        .ok_or_else(|| wrong("a streamer of no device"))
}

/// Refuse settings of a streamer that a device does not support.
unsafe fn check_stream(args: *mut StreamArgs, cpu: &str, channels: &[usize]) -> Result<(), Fault> {
    // SAFETY: texts and channels are the caller's.
    unsafe {
        let args = at(args)?;
        text(args.args)?;
        let given = std::slice::from_raw_parts(args.channel_list, args.n_channels as usize);
        let wire = text(args.otw_format)?;
        match text(args.cpu_format)? == cpu && ["sc16", "sc12"].contains(&wire) && given == channels
        {
            true => Ok(()),
            false => Err(wrong("a streamer that the tests do not need")),
        }
    }
}

/// Export functions whose bodies return a result.
macro_rules! export {
    ($(fn $name:ident($($argument:ident: $type:ty),* $(,)?) $body:block)*) => {
        $(
            #[doc = "As in `uhd.h`."]
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($($argument: $type),*) -> c_uint {
                // SAFETY: callers follow the header: handles were made here, and pointers have their declared types.
                let result: Result<(), Fault> = unsafe { (|| { $body Ok(()) })() };
                answer(result)
            }
        )*
    };
}

export! {
    fn uhd_get_last_error(out: *mut c_char, len: usize) {
        let last = lock(&LAST).clone();
        put(&last, out, len)?;
    }

    fn uhd_get_version_string(out: *mut c_char, len: usize) { put("4.3.0.0-stand-in", out, len)?; }

    fn uhd_string_vector_make(h: *mut *mut Vec<String>) { make(h, Vec::new())?; }
    fn uhd_string_vector_free(h: *mut *mut Vec<String>) { free(h)?; }
    fn uhd_string_vector_size(h: *mut Vec<String>, size: *mut usize) { *at(size)? = at(h)?.len(); }
    fn uhd_string_vector_at(h: *mut Vec<String>, index: usize, out: *mut c_char, len: usize) {
        let there = at(h)?.get(index).ok_or((ERROR_INDEX, "IndexError".to_owned()))?;
        put(there, out, len)?;
    }
    fn uhd_meta_range_make(h: *mut *mut Range) { make(h, Range { from: 0.0, to: 0.0 })?; }
    fn uhd_meta_range_free(h: *mut *mut Range) { free(h)?; }
    fn uhd_meta_range_start(h: *mut Range, out: *mut f64) { *at(out)? = at(h)?.from; }
    fn uhd_meta_range_stop(h: *mut Range, out: *mut f64) { *at(out)? = at(h)?.to; }
    fn uhd_subdev_spec_make(h: *mut *mut String, markup: *const c_char) { make(h, text(markup)?.to_owned())?; }
    fn uhd_subdev_spec_free(h: *mut *mut String) { free(h)?; }
    fn uhd_sensor_value_make(h: *mut *mut f64) { make(h, 0.0)?; }
    fn uhd_sensor_value_free(h: *mut *mut f64) { free(h)?; }
    fn uhd_sensor_value_to_bool(h: *mut f64, out: *mut bool) { *at(out)? = *at(h)? != 0.0; }
    fn uhd_sensor_value_to_realnum(h: *mut f64, out: *mut f64) { *at(out)? = *at(h)?; }

    fn uhd_usrp_find(args: *const c_char, found: *mut *mut Vec<String>) {
        let args = text(args)?;
        let list = at(*at(found)?)?;
        list.clear();
        let faults = std::env::var(scene::FAULTS).unwrap_or_default();
        let serials = if faults == "two" { &["SIM00001", "SIM00002"][..] } else { &["SIM00001"] };
        for serial in serials {
            if args.is_empty() || args == format!("serial={serial}") {
                list.push(format!("type=b200,name=,serial={serial},product=B210"));
            }
        }
    }
    fn uhd_usrp_make(h: *mut *mut Shared, args: *const c_char) {
        if !text(args)?.contains("serial=SIM00001") {
            return Err((11, format!("LookupError: KeyError: No devices found for ----->\n{}", text(args)?)));
        }
        let faults = std::env::var(scene::FAULTS).unwrap_or_default();
        if faults == "images" {
            // Text and code (error::IO) of UHD itself.
            let said = "RuntimeError: Could not find path for image: usrp_b200_fw.hex\n\nUsing images directory: <no images directory located>";
            return Err((30, said.to_owned()));
        }
        // A process has one radio.
        let experiment = Box::leak(Box::new(scene::experiment()));
        let radio = Box::new(scene::radio(experiment, &faults));
        make(h, Arc::new(Mutex::new(Device::new(radio))))?;
    }
    fn uhd_usrp_free(h: *mut *mut Shared) { free(h)?; }
    fn uhd_usrp_get_mboard_name(h: *mut Shared, _board: usize, out: *mut c_char, len: usize) {
        drop(device(h)?);
        put("B210", out, len)?;
    }
    fn uhd_usrp_set_clock_source(h: *mut Shared, source: *const c_char, _board: usize) {
        drop(device(h)?);
        if text(source)? == "gpsdo" && !has_gpsdo() {
            return Err(wrong("no GPSDO"));
        }
    }
    fn uhd_usrp_set_time_source(h: *mut Shared, source: *const c_char, _board: usize) {
        drop(device(h)?);
        text(source)?;
    }
    fn uhd_usrp_set_time_unknown_pps(h: *mut Shared, _full: i64, _frac: f64) {
        drop(device(h)?);
        if has_gpsdo() {
            return Ok(());
        }
        let said = "RuntimeError: Board 0 may not be getting a PPS signal!\nNo PPS detected within the time interval.";
        refuse((ERROR_RUNTIME, said.to_owned()))?;
    }
    fn uhd_usrp_get_time_now(h: *mut Shared, _board: usize, full: *mut i64, frac: *mut f64) {
        let now_s = device(h)?.now_s()?;
        (*at(full)?, *at(frac)?) = (now_s.floor() as i64, now_s - now_s.floor());
    }
    fn uhd_usrp_set_command_time(h: *mut Shared, _full: i64, _frac: f64, _board: usize) {
        drop(device(h)?);
        refuse(wrong("a B210 has no timed commands"))?;
    }
    fn uhd_usrp_clear_command_time(h: *mut Shared, _board: usize) { drop(device(h)?); }
    fn uhd_usrp_set_master_clock_rate(h: *mut Shared, rate: f64, _board: usize) {
        device(h)?.ask(|it| it.master_clock_hz = rate);
    }
    fn uhd_usrp_get_master_clock_rate(h: *mut Shared, _board: usize, out: *mut f64) {
        *at(out)? = device(h)?.set()?.master_clock_hz;
    }
    fn uhd_usrp_get_mboard_sensor_names(h: *mut Shared, _board: usize, names: *mut *mut Vec<String>) {
        drop(device(h)?);
        let all = if has_gpsdo() { &["gps_locked", "gps_time", "ref_locked"][..] } else { &["ref_locked"] };
        *at(*at(names)?)? = all.iter().map(|&name| name.to_owned()).collect();
    }
    fn uhd_usrp_get_mboard_sensor(h: *mut Shared, name: *const c_char, _board: usize, value: *mut *mut f64) {
        if text(name)? == "gps_locked" && has_gpsdo() {
            *at(*at(value)?)? = 1.0;
            return Ok(());
        }
        if text(name)? != "ref_locked" {
            return Err((41, "LookupError: no such sensor".to_owned()));
        }
        // The reference clock locks after some reads.
        let mut device = device(h)?;
        device.reference += 1;
        *at(*at(value)?)? = f64::from(u8::from(device.reference > 2));
    }

    fn uhd_usrp_set_rx_subdev_spec(h: *mut Shared, spec: *mut String, _board: usize) {
        device(h)?.subdevices = at(spec)? == "A:A A:B";
    }
    fn uhd_usrp_set_rx_rate(h: *mut Shared, rate: f64, channel: usize) {
        let mut device = device(h)?;
        device.channel(channel, 2)?;
        device.ask(|it| it.sample_rate_hz = rate);
    }
    fn uhd_usrp_get_rx_rate(h: *mut Shared, channel: usize, out: *mut f64) {
        let mut device = device(h)?;
        device.channel(channel, 2)?;
        *at(out)? = device.set()?.sample_rate_hz;
    }
    fn uhd_usrp_set_rx_freq(h: *mut Shared, request: *mut TuneRequest, channel: usize, result: *mut [f64; 5]) {
        let (mut device, request) = (device(h)?, at(request)?);
        device.channel(channel, 2)?;
        text(request.args)?;
        if [request.rf_policy, request.dsp_policy] != [65, 65] {
            return Err(wrong("a policy that the tests do not need"));
        }
        let hz = device.tune_rx(request.target_hz, channel)?;
        *at(result)? = [hz, hz, hz, request.rf_hz, request.dsp_hz];
    }
    fn uhd_usrp_get_rx_freq(h: *mut Shared, channel: usize, out: *mut f64) {
        let device = device(h)?;
        *at(out)? = device.tuned_hz[1 + device.channel(channel, 2)?];
    }
    fn uhd_usrp_get_rx_freq_range(h: *mut Shared, _channel: usize, range: *mut Range) {
        *at(range)? = device(h)?.ranges().carrier_hz;
    }
    fn uhd_usrp_set_rx_gain(h: *mut Shared, gain: f64, channel: usize, _name: *const c_char) {
        let mut device = device(h)?;
        let channel = device.channel(channel, 2)?;
        device.ask(|it| it.receive_gain_db[channel] = gain);
    }
    fn uhd_usrp_get_rx_gain(h: *mut Shared, channel: usize, _name: *const c_char, out: *mut f64) {
        let mut device = device(h)?;
        let channel = device.channel(channel, 2)?;
        *at(out)? = device.set()?.receive_gain_db[channel];
    }
    fn uhd_usrp_get_rx_gain_range(h: *mut Shared, _name: *const c_char, _channel: usize, range: *mut Range) {
        *at(range)? = device(h)?.ranges().receive_gain_db;
    }
    fn uhd_usrp_set_rx_antenna(h: *mut Shared, antenna: *const c_char, channel: usize) {
        let mut device = device(h)?;
        let (channel, antenna) = (device.channel(channel, 2)?, text(antenna)?.to_owned());
        device.ask(|it| it.receive_antennas[channel] = antenna);
    }
    fn uhd_usrp_get_rx_antennas(h: *mut Shared, _channel: usize, antennas: *mut *mut Vec<String>) {
        *at(*at(antennas)?)? = device(h)?.ranges().receive_antennas.clone();
    }
    fn uhd_usrp_set_rx_bandwidth(h: *mut Shared, hz: f64, channel: usize) {
        let mut device = device(h)?;
        device.channel(channel, 2)?;
        device.ask(|it| it.bandwidth_hz = hz);
    }
    fn uhd_usrp_get_rx_bandwidth(h: *mut Shared, channel: usize, out: *mut f64) {
        let mut device = device(h)?;
        device.channel(channel, 2)?;
        *at(out)? = device.set()?.bandwidth_hz;
    }
    fn uhd_usrp_get_rx_bandwidth_range(h: *mut Shared, _channel: usize, range: *mut Range) {
        *at(range)? = device(h)?.ranges().bandwidth_hz;
    }
    fn uhd_usrp_get_rx_sensor_names(h: *mut Shared, _channel: usize, names: *mut *mut Vec<String>) {
        drop(device(h)?);
        *at(*at(names)?)? = vec!["temp".to_owned(), "lo_locked".to_owned()];
    }
    fn uhd_usrp_get_rx_sensor(h: *mut Shared, name: *const c_char, _channel: usize, value: *mut *mut f64) {
        *at(*at(value)?)? = match text(name)? {
            "lo_locked" => f64::from(u8::from(device(h)?.sensors()?.receive_locked)),
            "temp" => 31.5,
            _ => return Err((41, "LookupError: no such sensor".to_owned())),
        };
    }

    fn uhd_usrp_set_tx_subdev_spec(h: *mut Shared, spec: *mut String, _board: usize) {
        drop(device(h)?);
        if at(spec)? != "A:A" {
            return Err(wrong("an unknown subdevice"));
        }
    }
    fn uhd_usrp_set_tx_rate(h: *mut Shared, rate: f64, _channel: usize) {
        device(h)?.ask(|it| it.sample_rate_hz = rate);
    }
    fn uhd_usrp_get_tx_rate(h: *mut Shared, _channel: usize, out: *mut f64) {
        *at(out)? = device(h)?.set()?.sample_rate_hz;
    }
    fn uhd_usrp_set_tx_freq(h: *mut Shared, request: *mut TuneRequest, _channel: usize, result: *mut [f64; 5]) {
        let hz = device(h)?.tune_tx(at(request)?.target_hz)?;
        *at(result)? = [hz, hz, hz, 0.0, 0.0];
    }
    fn uhd_usrp_get_tx_freq(h: *mut Shared, _channel: usize, out: *mut f64) {
        *at(out)? = device(h)?.tuned_hz[0];
    }
    fn uhd_usrp_set_tx_gain(h: *mut Shared, gain: f64, _channel: usize, _name: *const c_char) {
        device(h)?.ask(|it| it.transmit_gain_db = gain);
    }
    fn uhd_usrp_get_tx_gain(h: *mut Shared, _channel: usize, _name: *const c_char, out: *mut f64) {
        *at(out)? = device(h)?.set()?.transmit_gain_db;
    }
    fn uhd_usrp_get_tx_gain_range(h: *mut Shared, _name: *const c_char, _channel: usize, range: *mut Range) {
        *at(range)? = device(h)?.ranges().transmit_gain_db;
    }
    fn uhd_usrp_set_tx_antenna(h: *mut Shared, antenna: *const c_char, _channel: usize) {
        let antenna = text(antenna)?.to_owned();
        device(h)?.ask(|it| it.transmit_antenna = antenna);
    }
    fn uhd_usrp_get_tx_antennas(h: *mut Shared, _channel: usize, antennas: *mut *mut Vec<String>) {
        *at(*at(antennas)?)? = device(h)?.ranges().transmit_antennas.clone();
    }
    fn uhd_usrp_set_tx_bandwidth(h: *mut Shared, _hz: f64, _channel: usize) { drop(device(h)?); }
    fn uhd_usrp_get_tx_sensor(h: *mut Shared, name: *const c_char, _channel: usize, value: *mut *mut f64) {
        if text(name)? != "lo_locked" {
            return Err((41, "LookupError: no such sensor".to_owned()));
        }
        *at(*at(value)?)? = f64::from(u8::from(device(h)?.sensors()?.transmit_locked));
    }

    fn uhd_rx_streamer_make(h: *mut *mut Streamer) { make(h, None)?; }
    fn uhd_rx_streamer_free(h: *mut *mut Streamer) { free(h)?; }
    fn uhd_usrp_get_rx_stream(h: *mut Shared, args: *mut StreamArgs, streamer: *mut Streamer) {
        check_stream(args, "sc16", &[0, 1])?;
        device(h)?.channel(1, 2)?;
        *at(streamer)? = Some(Arc::clone(at(h)?));
    }
    fn uhd_rx_streamer_max_num_samps(h: *mut Streamer, most: *mut usize) {
        drop(stream(h)?);
        *at(most)? = PACKET;
    }
    fn uhd_rx_streamer_issue_stream_cmd(h: *mut Streamer, command: *mut StreamCommand) {
        let command = at(command)?;
        if command.stream_mode != 100 || command.stream_now {
            let said = "RuntimeError: Invalid recv stream command - stream now on multiple channels in a single streamer will fail to time align.";
            return Err((ERROR_RUNTIME, said.to_owned()));
        }
        stream(h)?.command(command.num_samps, command.full as f64 + command.frac)?;
    }
    fn uhd_rx_streamer_recv(
        h: *mut Streamer, buffers: *mut *mut Sample, samples: usize, metadata: *mut *mut RxMetadata, _timeout: f64,
        one_packet: bool, received: *mut usize,
    ) {
        let (mut device, received) = (stream(h)?, at(received)?);
        let metadata = at(*at(metadata)?)?;
        if samples < PACKET || !one_packet {
            return Err(wrong("fragments of packets"));
        }
        *received = 0;
        *metadata = match device.receive() {
            // The time limit is over.
            None => RxMetadata { code: 1, ..RxMetadata::default() },
            Some((Waiting::Error(code, out_of_sequence), time_s)) => RxMetadata { code, out_of_sequence, time_s },
            Some((Waiting::Samples(range), time_s)) => {
                for channel in 0..2 {
                    let from = device.samples(channel, &range);
                    let buffer = at(*buffers.add(channel))?;
                    std::slice::from_raw_parts_mut(buffer, samples)[..from.len()].copy_from_slice(from);
                }
                *received = range.len();
                RxMetadata { time_s, ..RxMetadata::default() }
            }
        };
    }
    fn uhd_rx_metadata_make(h: *mut *mut RxMetadata) { make(h, RxMetadata::default())?; }
    fn uhd_rx_metadata_free(h: *mut *mut RxMetadata) { free(h)?; }
    fn uhd_rx_metadata_error_code(h: *mut RxMetadata, code: *mut c_uint) { *at(code)? = at(h)?.code; }
    fn uhd_rx_metadata_out_of_sequence(h: *mut RxMetadata, is: *mut bool) { *at(is)? = at(h)?.out_of_sequence; }
    fn uhd_rx_metadata_time_spec(h: *mut RxMetadata, full: *mut i64, frac: *mut f64) {
        let time_s = at(h)?.time_s;
        (*at(full)?, *at(frac)?) = (time_s.floor() as i64, time_s - time_s.floor());
    }

    fn uhd_tx_streamer_make(h: *mut *mut Streamer) { make(h, None)?; }
    fn uhd_tx_streamer_free(h: *mut *mut Streamer) { free(h)?; }
    fn uhd_usrp_get_tx_stream(h: *mut Shared, args: *mut StreamArgs, streamer: *mut Streamer) {
        check_stream(args, "fc32", &[0])?;
        *at(streamer)? = Some(Arc::clone(at(h)?));
    }
    fn uhd_tx_streamer_max_num_samps(h: *mut Streamer, most: *mut usize) {
        drop(stream(h)?);
        *at(most)? = PACKET;
    }
    fn uhd_tx_streamer_send(
        h: *mut Streamer, buffers: *mut *mut Complex32, samples: usize, metadata: *mut *mut TxMetadata, _timeout: f64,
        sent: *mut usize,
    ) {
        let metadata = at(*at(metadata)?)?;
        let samples = std::slice::from_raw_parts(at(*at(buffers)?)?, samples);
        *at(sent)? = stream(h)?.send(samples, metadata.at_s, metadata.last)?;
    }
    fn uhd_tx_metadata_make(h: *mut *mut TxMetadata, has_time: bool, full: i64, frac: f64, first: bool, last: bool) {
        if has_time != first {
            return Err(wrong("a burst without its time"));
        }
        make(h, TxMetadata { at_s: first.then_some(full as f64 + frac), last })?;
    }
    fn uhd_tx_metadata_free(h: *mut *mut TxMetadata) { free(h)?; }
    fn uhd_async_metadata_make(h: *mut *mut c_uint) { make(h, 0)?; }
    fn uhd_async_metadata_free(h: *mut *mut c_uint) { free(h)?; }
    fn uhd_tx_streamer_recv_async_msg(h: *mut Streamer, metadata: *mut *mut c_uint, _timeout: f64, valid: *mut bool) {
        let said = stream(h)?.said.pop_front();
        *at(valid)? = said.is_some();
        *at(*at(metadata)?)? = said.unwrap_or_default();
    }
    fn uhd_async_metadata_event_code(h: *mut c_uint, code: *mut c_uint) { *at(code)? = *at(h)?; }
}
