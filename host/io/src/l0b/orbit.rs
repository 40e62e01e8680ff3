//! State vectors of an orbit, and the orbit between them: [`StateVectors`].

use glam::DVec3;

use super::tree::{Epoch, Tree};
use subaperture_model::phase_history::ReadError;
use subaperture_model::track::StateVectors;

/// Number of state vectors through which a polynomial passes.
const SUPPORT: usize = StateVectors::SUPPORT[0];

/// State vectors of an orbit, ECF.
pub(super) struct Orbit {
    /// Reference of the times.
    pub(super) epoch: Epoch,
    vectors: StateVectors,
}

/// Position and velocity in metres and metres per second.
pub(super) type State = [DVec3; 2];

impl Orbit {
    /// Read the group at `path`, with at most `memory_bytes` of memory.
    pub(super) fn read(tree: &Tree, path: &str, memory_bytes: u64) -> Result<Self, ReadError> {
        let fault = |text: String| tree.source().malformed(format!("{path}: {text}"));
        let of = |name: &str| format!("{path}/{name}");
        if (tree.data_sets(path)?.iter()).any(|name| name == "interpMethod") {
            let method = tree.text(&of("interpMethod"))?;
            if method != "Hermite" {
                return Err(fault(format!(
                    "expected interpMethod Hermite, found '{method}', which is not supported"
                )));
            }
        }
        let times = tree.shape(&of("time"))?;
        let &[count] = times.as_slice() else {
            return Err(fault(format!("expected times in a row, found {times:?}")));
        };
        if count < SUPPORT as u64 {
            return Err(fault(format!(
                "expected at least {SUPPORT} state vectors, found {count}"
            )));
        }
        // The values, and those being converted.
        let needed = count.saturating_mul(8 * (7 + 6));
        tree.source().check_memory(needed, memory_bytes)?;
        let times_s = tree.table(&of("time"), count, 1, memory_bytes)?;
        if let Some(at) = times_s.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(fault(format!(
                "expected ascending times, found {:?} s before {:?} s",
                times_s[at],
                times_s[at + 1]
            )));
        }
        let vectors = |name: &str| -> Result<Vec<DVec3>, ReadError> {
            let values = tree.table(&of(name), count, 3, memory_bytes)?;
            let vectors = values.chunks_exact(3).map(DVec3::from_slice);
            Ok(vectors.collect())
        };
        let (positions_m, velocities_m_s) = (vectors("position")?, vectors("velocity")?);
        let vectors = StateVectors::new(times_s, positions_m, Some(velocities_m_s));
        Ok(Self {
            epoch: tree.epoch(&of("time"))?,
            vectors: vectors.map_err(|error| fault(error.to_string()))?,
        })
    }

    /// First and last time, seconds after the epoch.
    pub(super) fn span_s(&self) -> [f64; 2] {
        self.vectors.span_s()
    }

    /// Memory of the state vectors, bytes.
    pub(super) fn held_bytes(&self) -> u64 {
        self.vectors.held_bytes()
    }

    /// Position and velocity at a time, seconds after the epoch.
    pub(super) fn at(&self, time_s: f64) -> State {
        self.vectors.at(time_s)
    }
}
