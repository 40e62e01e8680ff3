//! Antenna positions over time at selected pulses of the recording, for image formats that store the radar's
//! trajectory.

use glam::DVec3;
use serde_json::{Value, json};

use subaperture_model::phase_history::PhaseHistory;

/// Maximum number of pulses: twenty per coefficient of a fifth-order polynomial.
const MOST: usize = 129;

/// Times and antenna positions of pulses from first to last. For several channels, those of the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Antennas {
    /// UTC of time 0 in nanoseconds since 1970. `None` if the recording does not state it.
    pub start_ns: Option<i64>,
    /// Whether times are known. If not, they are pulse numbers.
    pub timed: bool,
    /// Times in seconds.
    pub times_s: Vec<f64>,
    /// Transmitting antenna positions in metres in the scene frame.
    pub transmitters_m: Vec<DVec3>,
    /// Receiving antenna positions in metres in the scene frame.
    pub receivers_m: Vec<DVec3>,
}

impl Antennas {
    /// Select the antenna positions of a recording.
    pub fn of(history: &dyn PhaseHistory) -> Self {
        let collection = history.collection();
        let turns = collection.num_turns();
        let kept = turns.min(MOST);
        let chosen = (0..kept).map(|i| i * (turns - 1) / (kept - 1).max(1));
        let pulses: Vec<_> = chosen.map(|n| &collection.pulses[n]).collect();
        Self {
            start_ns: history.start_ns(),
            timed: collection.timed,
            times_s: pulses.iter().map(|pulse| pulse.time_s).collect(),
            transmitters_m: pulses.iter().map(|pulse| pulse.transmitter_m).collect(),
            receivers_m: pulses.iter().map(|pulse| pulse.receiver_m).collect(),
        }
    }

    /// Convert to JSON for a record.
    pub fn to_json(&self) -> Value {
        let numbers = |all: &[DVec3]| all.iter().map(|v| v.to_array()).collect::<Vec<_>>();
        let mut value = json!({
            "start_ns": self.start_ns,
            "timed": self.timed,
            "times_s": self.times_s,
            "transmitters_m": numbers(&self.transmitters_m),
        });
        if self.receivers_m != self.transmitters_m {
            value["receivers_m"] = json!(numbers(&self.receivers_m));
        }
        value
    }

    /// Read the `antennas` of a record. `None` if they are missing or invalid.
    pub fn of_json(value: &Value) -> Option<Self> {
        let vector = |v: &Value| {
            let at = |k: usize| v[k].as_f64().filter(|x| x.is_finite());
            Some(DVec3::new(at(0)?, at(1)?, at(2)?))
        };
        let vectors = |name: &str| -> Option<Vec<DVec3>> {
            value[name].as_array()?.iter().map(vector).collect()
        };
        let times_s: Option<Vec<f64>> = value["times_s"]
            .as_array()?
            .iter()
            .map(Value::as_f64)
            .collect();
        let transmitters_m: Vec<DVec3> = vectors("transmitters_m")?;
        let all = Self {
            start_ns: value["start_ns"].as_i64(),
            timed: value["timed"].as_bool()?,
            times_s: times_s?,
            receivers_m: match value["receivers_m"].is_null() {
                true => transmitters_m.clone(),
                false => vectors("receivers_m")?,
            },
            transmitters_m,
        };
        let count = all.times_s.len();
        let whole = count > 0
            && all.times_s.is_sorted_by(|a, b| a < b)
            && [&all.transmitters_m, &all.receivers_m]
                .into_iter()
                .all(|v| v.len() == count);
        whole.then_some(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::{Collection, InMemory, Pulse, Sweep};

    #[test]
    fn first_and_last_pulse_are_selected_and_read_back() {
        let pulse = |n: usize| Pulse {
            time_s: 0.1 * n as f64,
            transmitter_m: DVec3::new(n as f64, 1.0, 2.0),
            receiver_m: DVec3::new(n as f64, 1.5, 2.0),
            reference_m: DVec3::ZERO,
            reference_path_m: 4.0,
            start_hz: 1e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        let count = 1000;
        let collection = Collection {
            name: String::new(),
            num_samples: 1,
            pulses: (0..count).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let samples = vec![Complex32::default(); count];
        let history = InMemory::new(collection, samples).unwrap();
        let all = Antennas::of(&history);
        assert_eq!(all.times_s.len(), MOST);
        assert_eq!(all.transmitters_m[0].x, 0.0);
        assert_eq!(all.receivers_m[MOST - 1], DVec3::new(999.0, 1.5, 2.0));
        let text = all.to_json().to_string();
        let value: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(Antennas::of_json(&value), Some(all));
        for (key, bad) in [
            ("times_s", json!([1, 2])),
            ("timed", json!(3)),
            ("receivers_m", json!([])),
        ] {
            let mut value = value.clone();
            value[key] = bad;
            assert_eq!(Antennas::of_json(&value), None, "{key}");
        }
        assert_eq!(Antennas::of_json(&Value::Null), None);
    }
}
