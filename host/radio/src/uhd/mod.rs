//! USRP with Ettus Research's driver UHD: a B210, or a device with the same two receivers and one transmitter.
//!
//! Needs the feature `uhd`, and UHD 4.3 or later to link with (Debian: `libuhd-dev`). **Licence:** this crate is
//! licensed under MIT or Apache-2.0; UHD under GPL-3.0-or-later, or under a commercial licence from Ettus Research. A
//! program linked with UHD is distributed under the GPL as a whole, unless that licence was bought. Without the
//! feature, nothing of UHD is needed or contained.
//!
//! # Use of UHD
//! - Devices are searched by serial number (`uhd_usrp_find`). UHD loads firmware and FPGA image when it opens the
//!   device; errors give advice if images or permissions are missing.
//! - Burst: the receivers are commanded to start at the burst's time (`issue_stream_cmd`; two channels start together
//!   only with a start time). Then, in one thread, packets are sent while there is room, one is received, and so on.
//!   Samples are stored by their packets' timestamps; samples without a packet are lost. At the end the transmitter's
//!   acknowledgement is awaited, so that a retune does not truncate the transmission.
//! - Sample rates of a B210 are its master clock divided by an integer; UHD takes the nearest. The rate in effect is
//!   used and recorded, and the tone's frequency follows it, since it has a whole number of samples per period. Gains
//!   are rounded too. Limits of carriers, bandwidths and gains are reported by UHD. Those of master clock and rate are
//!   a B210's, 5 to 30.72 MHz with two receivers, for all devices: an X300, with master clocks of 200 and 184.32 MHz,
//!   is therefore refused.
//! - Waveforms are float32 until UHD rounds them to the wire format. Samples arrive with 16 bits, or as the upper 12 of
//!   them ([`Options::wire`]).
//! - A B210's synthesisers have no timed commands: scheduled retunes are refused.
//! - UHD logs to standard error; `UHD_LOG_CONSOLE_LEVEL=off` and `UHD_LOG_FASTPATH_DISABLE=1` in the environment
//!   silence it.
//! - After the device is disconnected, every call returns [`RadioError::Gone`].
//!
//! Not tested on a real device: tests use a library with UHD's interface that answers from the simulated radio.

mod burst;
#[allow(unsafe_code)]
mod calls;
mod errors;
#[allow(unsafe_code)]
mod ffi;
#[allow(unsafe_code)]
mod streams;

use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::error::RadioError;
use crate::transceiver::{
    About, Burst, Configuration, Event, EventKind, Ranges, Received, Sample, Sensors, Side, Source,
    Transceiver, check_burst,
};

use burst::Streams;
use calls::{Port, Usrp};

/// Time allowed for locking to an external reference.
const LOCK: Duration = Duration::from_secs(2);

/// Wire format of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wire {
    /// 16 bits per I and Q.
    #[default]
    Sc16,
    /// 12 bits per I and Q, the resolution of an AD9361; three quarters of the data rate.
    Sc12,
}

/// Device selection and wire format.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Serial number; `None` selects the only device connected.
    pub serial: Option<String>,
    /// Transmit subdevice specification, in UHD's notation.
    pub transmit_subdevice: String,
    /// Receive subdevice specification of the two receivers, in UHD's notation.
    pub receive_subdevices: String,
    /// Wire format of samples.
    pub wire: Wire,
}

impl Default for Options {
    /// The only B210 connected: transmitter A, receivers A and B, 16 bits.
    fn default() -> Self {
        Self {
            serial: None,
            transmit_subdevice: "A:A".to_owned(),
            receive_subdevices: "A:A A:B".to_owned(),
            wire: Wire::default(),
        }
    }
}

/// Device found by UHD.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Product name, for example `B210`.
    pub product: String,
    /// Serial number, by which the device is selected.
    pub serial: String,
    /// UHD's device address, for example `type=b200,name=,serial=...`.
    pub address: String,
}

/// List the devices that UHD finds, optionally with a given serial number. Takes about a second, and also searches the
/// network.
///
/// # Errors
/// [`RadioError::Driver`] with UHD's message.
pub fn list(serial: Option<&str>) -> Result<Vec<Found>, RadioError> {
    let args = serial.map_or(String::new(), |serial| format!("serial={serial}"));
    let found = calls::find(&args)?;
    let of = |address: &str, key: &str| {
        let mut pairs = address.split(',').filter_map(|pair| pair.split_once('='));
        let value = pairs.find(|(name, _)| name.trim() == key);
        value.map_or(String::new(), |(_, value)| value.trim().to_owned())
    };
    Ok(found
        .into_iter()
        .map(|address| Found {
            product: of(&address, "product"),
            serial: of(&address, "serial"),
            address,
        })
        .collect())
}

/// Error for a search without result, with advice.
pub fn none_found(serial: Option<&str>) -> RadioError {
    let which = serial.map_or(String::new(), |serial| {
        format!(" with serial number {serial}")
    });
    RadioError::Driver(format!("UHD found no radio{which}; {}", errors::NO_DEVICE))
}

/// Radio driven by UHD.
#[derive(Debug)]
pub struct UhdRadio {
    // Dropped before the device.
    streams: Option<Streams>,
    usrp: Usrp,
    about: About,
    wire: Wire,
    has_temperature: bool,
    has_gps: bool,
    configuration: Option<Configuration>,
    tuned: [bool; 2],
    gone: Option<String>,
    events: Vec<Event>,
}

impl UhdRadio {
    /// Open a device. Takes seconds if its image must be loaded.
    ///
    /// # Errors
    /// [`RadioError::Driver`] if no device is found, if several are found and no serial number is given, or with UHD's
    /// message and advice.
    pub fn open(options: &Options) -> Result<Self, RadioError> {
        let found = list(options.serial.as_deref())?;
        let found = match &found[..] {
            [one] => one,
            [] => return Err(none_found(options.serial.as_deref())),
            several => {
                let serials: Vec<&str> = several.iter().map(|one| one.serial.as_str()).collect();
                return Err(RadioError::Driver(format!(
                    "UHD found {} radios: choose one by its serial number: {}",
                    several.len(),
                    serials.join(", ")
                )));
            }
        };
        let usrp = Usrp::make(&found.address)?;
        usrp.set_subdevices(&options.transmit_subdevice, &options.receive_subdevices)?;
        let product = usrp.board_name()?;
        let ranges = Ranges {
            carrier_hz: usrp.carriers_hz()?,
            bandwidth_hz: usrp.bandwidths_hz()?,
            transmit_gain_db: usrp.transmit_gains_db()?,
            receive_gain_db: usrp.receive_gains_db()?,
            transmit_antennas: usrp.antennas(Port::Tx)?,
            receive_antennas: usrp.antennas(Port::Rx(0))?,
            timed_tune: product.starts_with("X3"),
            // UHD's C interface does not report the other limits.
            ..Ranges::b210()
        };
        let (sensors, on_board) = (usrp.receive_sensors()?, usrp.board_sensors()?);
        Ok(Self {
            streams: None,
            about: About {
                product,
                serial: found.serial.clone(),
                driver: format!("UHD {}", calls::version()?),
                ranges,
            },
            usrp,
            wire: options.wire,
            has_temperature: sensors.iter().any(|name| name == "temp"),
            has_gps: on_board.iter().any(|name| name == "gps_locked"),
            configuration: None,
            tuned: [false; 2],
            gone: None,
            events: Vec::new(),
        })
    }

    /// Run `act` unless the device is disconnected, and record a disconnection that it reports.
    fn here<T>(
        &mut self,
        act: impl FnOnce(&mut Self) -> Result<T, RadioError>,
    ) -> Result<T, RadioError> {
        if let Some(message) = &self.gone {
            return Err(RadioError::Gone(message.clone()));
        }
        let done = act(self);
        if let Err(RadioError::Gone(message)) = &done {
            self.gone = Some(message.clone());
            self.events.push(Event {
                kind: EventKind::Gone,
                time_s: None,
                count: 1,
            });
        }
        done
    }

    fn set(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        // Streamers become invalid when the master clock changes.
        (self.streams, self.configuration, self.tuned) = (None, None, [false; 2]);
        let usrp = &self.usrp;
        usrp.set_sources(source(asked.clock), source(asked.pps))?;
        let master_clock_hz = usrp.set_master_clock_hz(asked.master_clock_hz)?;
        let rates_hz = [Port::Rx(0), Port::Rx(1), Port::Tx]
            .map(|port| usrp.set_rate_hz(port, asked.sample_rate_hz));
        let [rate_hz, second_hz, transmit_hz] = rates_hz;
        let sample_rate_hz = rate_hz?;
        if second_hz? != sample_rate_hz || transmit_hz? != sample_rate_hz {
            return Err(RadioError::Unsupported(format!(
                "sample rate of {} Hz gives different transmit and receive rates: choose the master clock rate divided by an integer",
                asked.sample_rate_hz
            )));
        }
        let bandwidth_hz = usrp.set_bandwidth_hz(asked.bandwidth_hz)?;
        let transmit_gain_db = usrp.set_gain_db(Port::Tx, asked.transmit_gain_db)?;
        let [first_db, second_db] = asked.receive_gain_db;
        let receive_gain_db = [
            usrp.set_gain_db(Port::Rx(0), first_db)?,
            usrp.set_gain_db(Port::Rx(1), second_db)?,
        ];
        usrp.set_antenna(Port::Tx, &asked.transmit_antenna)?;
        for (channel, antenna) in asked.receive_antennas.iter().enumerate() {
            usrp.set_antenna(Port::Rx(channel), antenna)?;
        }
        if asked.clock != Source::Internal {
            let began = Instant::now();
            while !usrp.reference_locked()? {
                if began.elapsed() > LOCK {
                    return Err(RadioError::Driver(
                        "no lock to the reference clock: connect 10 MHz, or use the internal clock"
                            .to_owned(),
                    ));
                }
                sleep(Duration::from_millis(20));
            }
        }
        // The internal pulse per second carries no external time.
        if asked.pps != Source::Internal {
            usrp.zero_time_at_pps()?;
        }
        let wire = match self.wire {
            Wire::Sc16 => "sc16",
            Wire::Sc12 => "sc12",
        };
        self.streams = Some(Streams::new(usrp, wire)?);
        Ok(Configuration {
            master_clock_hz,
            sample_rate_hz,
            bandwidth_hz,
            transmit_gain_db,
            receive_gain_db,
            ..asked.clone()
        })
    }
}

/// UHD's name of a clock or time source.
fn source(source: Source) -> &'static str {
    match source {
        Source::Internal => "internal",
        Source::External => "external",
        Source::Gpsdo => "gpsdo",
    }
}

impl Transceiver for UhdRadio {
    fn about(&self) -> &About {
        &self.about
    }

    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        asked.check(&self.about.ranges)?;
        let set = self.here(|radio| radio.set(asked))?;
        self.configuration = Some(set.clone());
        Ok(set)
    }

    fn now_s(&mut self) -> Result<f64, RadioError> {
        self.here(|radio| radio.usrp.now_s())
    }

    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        let ranges = &self.about.ranges;
        ranges.carrier_hz.check("carrier", carrier_hz, "Hz")?;
        if at_s.is_some() && !ranges.timed_tune {
            let what = "scheduled retune: the synthesisers are set over a separate bus without timestamps. Tune now, then schedule the burst";
            return Err(RadioError::Unsupported(what.to_owned()));
        }
        self.here(|radio| {
            let usrp = &radio.usrp;
            if at_s.is_some() {
                usrp.command_time(at_s)?;
            }
            let set = match side {
                Side::Transmit => usrp.tune_hz(Port::Tx, carrier_hz),
                // The receivers share a synthesiser; DSP tuning is set for each channel.
                Side::Receive => usrp
                    .tune_hz(Port::Rx(0), carrier_hz)
                    .and_then(|set| usrp.tune_hz(Port::Rx(1), carrier_hz).map(|_| set)),
            };
            if at_s.is_some() {
                usrp.command_time(None)?;
            }
            let set = set?;
            radio.tuned[usize::from(side == Side::Receive)] = true;
            Ok(set)
        })
    }

    fn burst(
        &mut self,
        burst: &Burst,
        receive: [&mut [Sample]; 2],
    ) -> Result<Received, RadioError> {
        check_burst(burst, &receive)?;
        self.here(|radio| {
            let (Some(streams), Some(set)) = (&mut radio.streams, &radio.configuration) else {
                return Err(RadioError::NotReady("configure the radio first"));
            };
            if radio.tuned != [true; 2] {
                return Err(RadioError::NotReady("tune both sides first"));
            }
            streams.burst(
                &radio.usrp,
                burst,
                set.sample_rate_hz,
                receive,
                &mut radio.events,
            )
        })
    }

    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        self.here(|radio| {
            let usrp = &radio.usrp;
            let has_reference =
                matches!(&radio.configuration, Some(set) if set.clock != Source::Internal);
            Ok(Sensors {
                transmit_locked: usrp.locked(Port::Tx)?,
                receive_locked: usrp.locked(Port::Rx(0))?,
                reference_locked: has_reference.then(|| usrp.reference_locked()).transpose()?,
                temperature_c: radio
                    .has_temperature
                    .then(|| usrp.temperature_c())
                    .transpose()?,
            })
        })
    }

    fn gps_locked(&mut self) -> Result<Option<bool>, RadioError> {
        self.here(|radio| radio.has_gps.then(|| radio.usrp.gps_locked()).transpose())
    }

    fn events(&mut self, events: &mut Vec<Event>) {
        events.append(&mut self.events);
    }
}
