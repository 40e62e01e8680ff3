//! What is connected to the radio's two receivers, and at which gains a signal is what the experiment says.

use num_complex::Complex64;

/// Cables, couplers and levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Wiring {
    /// What each receiver hears.
    pub receive: [Path; 2],
    /// Gain of the transmitter at which the echo of 1 m² at the reference point has the magnitude 1, dB.
    pub transmit_gain_db: f64,
    /// Gain of the receivers at which it is 1 at the converter too, dB.
    pub receive_gain_db: f64,
    /// Full scale of the converter, relative to that 1, dB; where the experiment names a converter, its own.
    pub full_scale_db: f64,
}

/// What a receiver hears.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// Index of its antenna among the experiment's receivers; none for a receiver that hears a coupler alone.
    pub antenna: Option<usize>,
    /// The transmitter by a coupler, or leaking from antenna to antenna.
    pub coupled: Option<Coupled>,
    /// Delay of the cables to its antenna and back, seconds.
    pub cable_s: f64,
    /// Its own gain and phase against the other.
    pub response: Complex64,
}

/// The transmitter heard directly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupled {
    /// On the way, seconds.
    pub delay_s: f64,
    /// Relative to the echo of 1 m² at the reference point.
    pub amplitude: f64,
}

impl Wiring {
    /// Chim 2018, Fig. 5.4: the coupler's cable of `loop_s` to receiver 0, antenna 0 to receiver 1 with cables of `cable_s`, which hears the transmitting
    /// antenna as `leakage`. The coupler's signal is as strong as the echo of 100 m², the converter's full scale 6 dB more.
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

    /// Two antennas that hear a third: antenna `i` to receiver `i` with cables of `cables_s[i]`, hearing the transmitter directly after `direct_s[i]` from phase centre to phase
    /// centre, as strong as the echo of `amplitude^2` m² at the reference point. The converter's full scale is twice that.
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
