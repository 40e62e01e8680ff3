//! Cables, couplers and levels between the antennas and the radio's two receivers.

use num_complex::Complex64;

/// Cables, couplers and reference levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Wiring {
    /// Signal path of each receiver.
    pub receive: [Path; 2],
    /// Transmit gain at which the echo of 1 m² at the reference point has magnitude 1, dB.
    pub transmit_gain_db: f64,
    /// Receive gain at which that echo has magnitude 1 at the converter, dB.
    pub receive_gain_db: f64,
    /// Full scale of the converter relative to that magnitude, dB. Ignored if the experiment has its own converter.
    pub full_scale_db: f64,
}

/// Signal path of a receiver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// Index of its antenna among the experiment's receivers; `None` for a receiver connected to a coupler only.
    pub antenna: Option<usize>,
    /// Direct transmitter signal, through a coupler or by leakage from antenna to antenna.
    pub coupled: Option<Coupled>,
    /// Total delay of the cables to the transmit and receive antennas, seconds.
    pub cable_s: f64,
    /// Complex gain of the receiver relative to the other.
    pub response: Complex64,
}

/// Direct signal from the transmitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupled {
    /// Delay, seconds.
    pub delay_s: f64,
    /// Amplitude relative to the echo of 1 m² at the reference point.
    pub amplitude: f64,
}

impl Wiring {
    /// Wiring of Chim 2018, Fig. 5.4. Receiver 0 has the coupler with a cable delay of `loop_s`. Receiver 1 has antenna
    /// 0 with a cable delay of `cable_s`, and receives the transmitter directly as `leakage`. The coupler's signal is
    /// as strong as the echo of 100 m²; the converter's full scale is 6 dB above it.
    pub fn loopback(loop_s: f64, cable_s: f64, leakage: Option<Coupled>) -> Self {
        let coupler = Path {
            antenna: None,
            coupled: Some(Coupled {
                delay_s: loop_s,
                amplitude: 10.0,
            }),
            cable_s: 0.0,
            response: Complex64::ONE,
        };
        let antenna = Path {
            antenna: Some(0),
            coupled: leakage,
            cable_s,
            response: Complex64::ONE,
        };
        Self {
            receive: [coupler, antenna],
            transmit_gain_db: 60.0,
            receive_gain_db: 40.0,
            full_scale_db: 26.0,
        }
    }

    /// Wiring with a leakage reference. Receiver `i` has antenna `i` with a cable delay of `cables_s[i]`, and receives
    /// the direct wave after `direct_s[i]` from phase centre to phase centre, as strong as the echo of `amplitude^2` m²
    /// at the reference point. The converter's full scale is twice that amplitude.
    pub fn leakage(direct_s: [f64; 2], cables_s: [f64; 2], amplitude: f64) -> Self {
        let receive = [0, 1].map(|i| Path {
            antenna: Some(i),
            coupled: Some(Coupled {
                delay_s: direct_s[i] + cables_s[i],
                amplitude,
            }),
            cable_s: cables_s[i],
            response: Complex64::ONE,
        });
        Self {
            receive,
            transmit_gain_db: 60.0,
            receive_gain_db: 40.0,
            full_scale_db: 20.0 * libm::log10(2.0 * amplitude),
        }
    }
}
