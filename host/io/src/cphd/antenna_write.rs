//! The `Antenna` branch of a file to be written.

use glam::DVec3;

use super::antenna_fit::{Described, gain_db};
use super::entry::Entry;
use crate::xml::Writer;

const SIDES: [&str; 2] = ["transmitter", "receiver"];

fn identifier(entry: &Entry, side: usize) -> String {
    format!("{} {}", entry.channel.id, SIDES[side])
}

/// Write the `Antenna` branch, if a channel has antennas.
pub(super) fn describe(w: &mut Writer, entries: &[Entry]) {
    let described: Vec<(&Entry, &Described)> = entries
        .iter()
        .filter_map(|entry| Some((entry, entry.antennas.as_ref()?)))
        .collect();
    if described.is_empty() {
        return;
    }
    let each = |f: &mut dyn FnMut(&Entry, &Described, usize)| {
        for (entry, antennas) in &described {
            (0..SIDES.len()).for_each(|side| f(entry, antennas, side));
        }
    };
    w.element("Antenna", "", |w| {
        for name in ["NumACFs", "NumAPCs", "NumAntPats"] {
            w.text(name, SIDES.len() * described.len());
        }
        each(&mut |entry, antennas, side| {
            w.element("AntCoordFrame", "", |w| {
                w.text("Identifier", identifier(entry, side));
                for (name, axis) in ["XAxisPoly", "YAxisPoly"].iter().zip(&antennas.axes[side]) {
                    w.element(name, "", |w| {
                        for (name, line) in ["X", "Y", "Z"].iter().zip(axis) {
                            polynomial(w, name, line);
                        }
                    });
                }
            });
        });
        each(&mut |entry, _, side| {
            w.element("AntPhaseCenter", "", |w| {
                w.text("Identifier", identifier(entry, side));
                w.text("ACFId", identifier(entry, side));
                w.xyz("APCXYZ", DVec3::ZERO);
            });
        });
        each(&mut |entry, antennas, side| {
            w.element("AntPattern", "", |w| {
                w.text("Identifier", identifier(entry, side));
                w.number("FreqZero", antennas.freq_zero_hz);
                w.text("EBFreqShift", false);
                w.text("MLFreqDilation", false);
                w.element("EB", "", |w| {
                    polynomial(w, "DCXPoly", &[0.0]);
                    polynomial(w, "DCYPoly", &[0.0]);
                });
                let none = [(0, 0, 0.0)];
                for (name, gain) in [
                    ("Array", gain_db(&antennas.antennas[side].pattern)),
                    ("Element", none.to_vec()),
                ] {
                    w.element(name, "", |w| {
                        surface(w, "GainPoly", &gain);
                        surface(w, "PhasePoly", &none);
                    });
                }
            });
        });
    });
}

/// Write which antennas a channel has, in its parameters.
pub(super) fn refer(w: &mut Writer, entry: &Entry) {
    if entry.antennas.is_none() {
        return;
    }
    w.element("Antenna", "", |w| {
        for (side, letters) in ["Tx", "Rcv"].iter().enumerate() {
            w.text(&format!("{letters}APCId"), identifier(entry, side));
            w.text(&format!("{letters}APATId"), identifier(entry, side));
        }
    });
}

fn polynomial(w: &mut Writer, name: &str, line: &[f64]) {
    let order = line.len().max(1) - 1;
    w.element(name, &format!("order1=\"{order}\""), |w| {
        for (n, coefficient) in line.iter().enumerate() {
            let attributes = format!("exponent1=\"{n}\"");
            w.text_with("Coef", &attributes, format_args!("{coefficient:?}"));
        }
    });
}

fn surface(w: &mut Writer, name: &str, terms: &[(usize, usize, f64)]) {
    let [most_x, most_y] = terms
        .iter()
        .fold([0, 0], |[x, y], term| [x.max(term.0), y.max(term.1)]);
    let orders = format!("order1=\"{most_x}\" order2=\"{most_y}\"");
    w.element(name, &orders, |w| {
        for (m, n, coefficient) in terms {
            let attributes = format!("exponent1=\"{m}\" exponent2=\"{n}\"");
            w.text_with("Coef", &attributes, format_args!("{coefficient:?}"));
        }
    });
}
