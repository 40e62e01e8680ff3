//! Where a module is: `tcp://HOST:PORT`, `serial:/dev/ttyX@BAUD` or `emulate:ARITHMETIC`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Speed of a serial line where none is given, bits a second.
const DEFAULT_BAUD: u32 = 921_600;

/// Where a module is.
///
/// ```
/// use subaperture_onboard::link::{Firmware, Place};
/// let place: Place = "serial:/dev/ttyACM0@115200".parse()?;
/// assert_eq!(place, Place::Serial { device: "/dev/ttyACM0".into(), baud: 115_200 });
/// assert_eq!("emulate".parse(), Ok(Place::Emulate(Firmware::Float)));
/// assert_eq!(place.to_string(), "serial:/dev/ttyACM0@115200");
/// # Ok::<(), subaperture_onboard::link::PlaceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A TCP port that leads to the module's serial line.
    Tcp {
        /// Name or address.
        host: String,
        /// Port.
        port: u16,
    },
    /// A serial device, 8 data bits, no parity, 1 stop bit, no flow control.
    Serial {
        /// Its file.
        device: PathBuf,
        /// Bits a second.
        baud: u32,
    },
    /// The firmware under emulation on this machine.
    Emulate(Firmware),
}

/// Firmware by the arithmetic of its maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Firmware {
    /// Float32.
    Float,
    /// 16-bit integers.
    Fixed,
}

impl Firmware {
    /// `float` or `fixed`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Fixed => "fixed",
        }
    }
}

/// A text that names no place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{text}' is no place of a module ({what}): give tcp://HOST:PORT, serial:/dev/ttyX, \
     serial:/dev/ttyX@BAUD, emulate:float or emulate:fixed"
)]
pub struct PlaceError {
    text: String,
    what: &'static str,
}

impl FromStr for Place {
    type Err = PlaceError;

    fn from_str(text: &str) -> Result<Self, PlaceError> {
        let wrong = |what| PlaceError {
            text: text.to_owned(),
            what,
        };
        if let Some(rest) = text.strip_prefix("tcp://") {
            let (host, port) = rest
                .rsplit_once(':')
                .ok_or_else(|| wrong("it has no port"))?;
            let host = host.trim_start_matches('[').trim_end_matches(']');
            if host.is_empty() {
                return Err(wrong("it has no host"));
            }
            let port = port.parse().ok().filter(|&port| port > 0);
            return Ok(Self::Tcp {
                host: host.to_owned(),
                port: port.ok_or_else(|| wrong("its port is not a number from 1 to 65535"))?,
            });
        }
        if let Some(rest) = text.strip_prefix("serial:") {
            let (device, baud) = match rest.rsplit_once('@') {
                None => (rest, DEFAULT_BAUD),
                Some((device, baud)) => {
                    let baud = baud.parse().ok().filter(|&baud| baud > 0);
                    (
                        device,
                        baud.ok_or_else(|| wrong("its speed is not a number of bits a second"))?,
                    )
                }
            };
            if device.is_empty() {
                return Err(wrong("it has no device"));
            }
            return Ok(Self::Serial {
                device: device.into(),
                baud,
            });
        }
        match text {
            "emulate" | "emulate:float" => Ok(Self::Emulate(Firmware::Float)),
            "emulate:fixed" => Ok(Self::Emulate(Firmware::Fixed)),
            _ if text.starts_with("emulate") => Err(wrong("there is no such firmware")),
            _ => Err(wrong("it begins with none of tcp, serial and emulate")),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp { host, port } if host.contains(':') => write!(f, "tcp://[{host}]:{port}"),
            Self::Tcp { host, port } => write!(f, "tcp://{host}:{port}"),
            Self::Serial { device, baud } => write!(f, "serial:{}@{baud}", device.display()),
            Self::Emulate(module) => write!(f, "emulate:{}", module.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_back_as_they_are_written() {
        for text in [
            "tcp://127.0.0.1:4000",
            "tcp://[::1]:1",
            "serial:/dev/ttyUSB0@9600",
            "emulate:float",
            "emulate:fixed",
        ] {
            let place: Place = text.parse().unwrap();
            assert_eq!(place.to_string(), text);
        }
        let place: Place = "serial:/dev/ttyACM0".parse().unwrap();
        assert_eq!(place.to_string(), "serial:/dev/ttyACM0@921600");
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (text, what) in [
            ("tcp://host", "no port"),
            ("tcp://host:0", "1 to 65535"),
            ("tcp://host:70000", "1 to 65535"),
            ("tcp://:80", "no host"),
            ("serial:", "no device"),
            ("serial:/dev/x@fast", "bits a second"),
            ("emulate:double", "no such firmware"),
            ("/dev/ttyACM0", "begins with none"),
            ("", "begins with none"),
        ] {
            let error = text.parse::<Place>().unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
            assert!(error.contains("tcp://HOST:PORT"), "{error}");
        }
    }
}
