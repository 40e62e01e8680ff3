//! Bistatic geometry at the centre of aperture (`SCPCOA/Bistatic`; SICD volume 1, 4.9.2).

use glam::DVec3;

use subaperture_io::xml::Writer;

use crate::aperture::Scpcoa;
use crate::contour::Sensor;
use crate::pair::Pair;

/// Bistatic angle and geometry of both platforms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bistatic {
    /// Degrees, and degrees per second.
    angle: [f64; 2],
    /// Transmitter and receiver, each with its time in seconds.
    platforms: [(f64, Scpcoa); 2],
}

impl Bistatic {
    /// Geometry of a scene point (ECF) at a time.
    pub(crate) fn new(pair: &Pair, time_s: f64, scp: DVec3) -> Self {
        let [sent_s, received_s] = pair.times_s(time_s);
        let platforms = [
            (sent_s, Scpcoa::new(&pair.transmitter, sent_s, scp)),
            (received_s, Scpcoa::new(&pair.receiver, received_s, scp)),
        ];
        let [t, r] = platforms.map(|(_, seen)| (seen.place - scp).normalize());
        let sensor: Sensor = pair.at(time_s);
        let [away, turning] = sensor.gradients(scp);
        let angle = 2.0 * libm::atan2((t - r).length(), (t + r).length());
        // |bisector|^2 = cos^2(angle / 2).
        let rate = match libm::sin(angle) {
            0.0 => 0.0,
            sine => -4.0 * away.dot(turning) / sine,
        };
        Self {
            angle: [angle.to_degrees(), rate.to_degrees()],
            platforms,
        }
    }

    /// Write `SCPCOA/Bistatic`: angle, rate and platforms.
    pub(crate) fn write(&self, w: &mut Writer) {
        w.element("Bistatic", "", |w| {
            let [angle, rate] = self.angle;
            w.numbers(&[("BistaticAng", angle), ("BistaticAngRate", rate)]);
            let names = ["TxPlatform", "RcvPlatform"];
            for (name, (time_s, seen)) in names.into_iter().zip(&self.platforms) {
                w.element(name, "", |w| {
                    w.number("Time", *time_s);
                    w.xyz("Pos", seen.place);
                    w.xyz("Vel", seen.velocity);
                    w.xyz("Acc", seen.acceleration);
                    seen.write_sides(w);
                    w.number("AzimAng", seen.azimuth);
                });
            }
        });
    }
}
