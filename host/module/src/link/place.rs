//! Address of a module: `tcp://HOST:PORT`, `serial:/dev/ttyX@BAUD` or `emulate:ARITHMETIC`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Default bit rate of a serial line in bits per second.
const DEFAULT_BAUD: u32 = 921_600;

/// Address of a module.
///
/// ```
/// use subaperture_module::link::{Firmware, ModuleAddress};
/// let address: ModuleAddress = "serial:/dev/ttyACM0@115200".parse()?;
/// assert_eq!(address, ModuleAddress::Serial { device: "/dev/ttyACM0".into(), baud: 115_200 });
/// assert_eq!("emulate".parse(), Ok(ModuleAddress::Emulate(Firmware::Float)));
/// assert_eq!(address.to_string(), "serial:/dev/ttyACM0@115200");
/// # Ok::<(), subaperture_module::link::ModuleAddressError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModuleAddress {
    /// TCP port connected to the module's serial line.
    Tcp {
        /// Host name or address.
        host: String,
        /// Port number.
        port: u16,
    },
    /// Serial device, 8 data bits, no parity, 1 stop bit, no flow control.
    Serial {
        /// Path of the device.
        device: PathBuf,
        /// Bit rate in bits per second.
        baud: u32,
    },
    /// Firmware emulated on this machine.
    Emulate(Firmware),
}

/// Firmware variant, by the arithmetic of its maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Firmware {
    /// Complex float32.
    Float,
    /// 16-bit fixed point.
    Fixed,
}

impl Firmware {
    /// Name of the variant: `float` or `fixed`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Fixed => "fixed",
        }
    }
}

/// Text that is not a valid module address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{text}' is not a module address ({what}): expected tcp://HOST:PORT, serial:/dev/ttyX, \
     serial:/dev/ttyX@BAUD, emulate:float or emulate:fixed"
)]
pub struct ModuleAddressError {
    text: String,
    what: &'static str,
}

impl FromStr for ModuleAddress {
    type Err = ModuleAddressError;

    fn from_str(text: &str) -> Result<Self, ModuleAddressError> {
        let wrong = |what| ModuleAddressError {
            text: text.to_owned(),
            what,
        };
        if let Some(rest) = text.strip_prefix("tcp://") {
            let (host, port) = rest.rsplit_once(':').ok_or_else(|| wrong("no port"))?;
            let host = host.trim_start_matches('[').trim_end_matches(']');
            if host.is_empty() {
                return Err(wrong("no host"));
            }
            let port = port.parse().ok().filter(|&port| port > 0);
            return Ok(Self::Tcp {
                host: host.to_owned(),
                port: port.ok_or_else(|| wrong("port is not a number from 1 to 65535"))?,
            });
        }
        if let Some(rest) = text.strip_prefix("serial:") {
            let (device, baud) = match rest.rsplit_once('@') {
                None => (rest, DEFAULT_BAUD),
                Some((device, baud)) => {
                    let baud = baud.parse().ok().filter(|&baud| baud > 0);
                    (
                        device,
                        baud.ok_or_else(|| {
                            wrong("bit rate is not a positive number of bits per second")
                        })?,
                    )
                }
            };
            if device.is_empty() {
                return Err(wrong("no device"));
            }
            return Ok(Self::Serial {
                device: device.into(),
                baud,
            });
        }
        match text {
            "emulate" | "emulate:float" => Ok(Self::Emulate(Firmware::Float)),
            "emulate:fixed" => Ok(Self::Emulate(Firmware::Fixed)),
            _ if text.starts_with("emulate") => Err(wrong("no such firmware")),
            _ => Err(wrong("unknown scheme")),
        }
    }
}

impl fmt::Display for ModuleAddress {
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
    fn address_round_trips_through_text() {
        for text in [
            "tcp://127.0.0.1:4000",
            "tcp://[::1]:1",
            "serial:/dev/ttyUSB0@9600",
            "emulate:float",
            "emulate:fixed",
        ] {
            let place: ModuleAddress = text.parse().unwrap();
            assert_eq!(place.to_string(), text);
        }
        let place: ModuleAddress = "serial:/dev/ttyACM0".parse().unwrap();
        assert_eq!(place.to_string(), "serial:/dev/ttyACM0@921600");
    }

    #[test]
    fn invalid_addresses_are_rejected_with_reason() {
        for (text, what) in [
            ("tcp://host", "no port"),
            ("tcp://host:0", "1 to 65535"),
            ("tcp://host:70000", "1 to 65535"),
            ("tcp://:80", "no host"),
            ("serial:", "no device"),
            ("serial:/dev/x@fast", "bits per second"),
            ("emulate:double", "no such firmware"),
            ("/dev/ttyACM0", "unknown scheme"),
            ("", "unknown scheme"),
        ] {
            let error = text.parse::<ModuleAddress>().unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
            assert!(error.contains("tcp://HOST:PORT"), "{error}");
        }
    }
}
