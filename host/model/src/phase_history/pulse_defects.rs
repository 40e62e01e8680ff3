//! Missing pulses and pulses of zeros of a phase history.

use num_complex::Complex32;

use super::{Defect, DefectKind, Examined, InMemory, PhaseHistory, ReadError};

/// Maximum number of samples examined, unless they are those of [`LEAST_PULSES`] pulses.
const MAX_VALUES: usize = 1 << 22;

/// Minimum number of examined pulses.
pub const LEAST_PULSES: usize = 32;

/// Indices of evenly spaced pulses for an examination of samples: at most 2^22 samples or 32 pulses, whichever is more.
pub fn examined_pulses(
    num_pulses: usize,
    num_samples: usize,
) -> impl ExactSizeIterator<Item = usize> + Clone {
    let count = (MAX_VALUES / num_samples.max(1))
        .max(LEAST_PULSES)
        .min(num_pulses);
    (0..count).map(move |i| (i as u128 * num_pulses as u128 / count as u128) as usize)
}

/// Missing pulses and pulses of zeros, among the pulses of [`examined_pulses`].
///
/// `number` is a pulse's index in its file. Missing pulses are gaps in pulse times ([`DefectKind::gaps`]); they are not examined where the
/// reader left pulses out.
///
/// # Errors
/// [`ReadError`] of reading pulses.
pub fn pulse_defects(
    history: &dyn PhaseHistory,
    number: &dyn Fn(usize) -> usize,
) -> Result<Vec<Defect>, ReadError> {
    let collection = history.collection();
    let chosen = examined_pulses(collection.pulses.len(), collection.num_samples);
    let count = chosen.len();
    let mut row = vec![Complex32::ZERO; collection.num_samples];
    let mut zeros = Vec::new();
    for n in chosen {
        history.read(n..n + 1, &mut row)?;
        if is_zero(&row) {
            zeros.push(n);
        }
    }
    Ok(defects(history, number, &zeros, count))
}

impl InMemory {
    /// Add missing pulses and pulses of zeros as defects with their warnings. All pulses are examined.
    #[must_use]
    pub fn with_pulse_defects(self) -> Self {
        let num_pulses = self.collection().pulses.len();
        let zeros: Vec<usize> = (0..num_pulses)
            .filter(|&n| self.samples_in_memory(n..n + 1).is_some_and(is_zero))
            .collect();
        let defects = defects(&self, &|n| n, &zeros, num_pulses);
        let warnings = defects.iter().map(Defect::warning).collect();
        self.with_warnings(warnings).with_defects(defects)
    }
}

fn is_zero(row: &[Complex32]) -> bool {
    row.iter().all(|z| *z == Complex32::ZERO)
}

/// Missing pulses, and pulses of `zeros` among a number of examined pulses.
fn defects(
    history: &dyn PhaseHistory,
    number: &dyn Fn(usize) -> usize,
    zeros: &[usize],
    examined: usize,
) -> Vec<Defect> {
    let collection = history.collection();
    let num_pulses = collection.pulses.len();
    let of = |examined_pulses: usize, kind: DefectKind| Defect {
        examined: Examined {
            recording: collection.name.clone(),
            channel: history.channels().first().map(|one| one.name.clone()),
            receiver: None,
            examined_pulses,
            pulses: num_pulses,
        },
        kind,
    };
    let mut defects = Vec::new();
    if collection.timed && (0..num_pulses).all(|n| number(n) == n) {
        let times_s: Vec<f64> = collection.pulses.iter().map(|pulse| pulse.time_s).collect();
        let gaps = DefectKind::gaps(&times_s, 0);
        defects.extend(gaps.map(|gaps| of(num_pulses, gaps)));
    }
    if let Some(&first) = zeros.first() {
        let kind = DefectKind::ZeroPulses {
            count: zeros.len(),
            first_pulse: number(first),
            channels: 1,
            left_out: false,
        };
        defects.push(of(examined, kind));
    }
    defects
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SceneFrame;
    use crate::phase_history::{Collection, Pulse, Sweep};
    use glam::DVec3;
    use std::ops::Range;

    /// 40 pulses 1 ms apart without those of 10 to 12 ms; pulses 4 and 20 contain only zeros.
    fn recording(num_samples: usize) -> InMemory {
        let times = (0..43).filter(|n| !(10..13).contains(n));
        let pulses: Vec<Pulse> = times
            .map(|n| Pulse {
                transmitter_m: DVec3::new(f64::from(n), -1000.0, 0.0),
                receiver_m: DVec3::new(f64::from(n), -1000.0, 0.0),
                reference_m: DVec3::ZERO,
                reference_path_m: 2000.0,
                start_hz: 1e10,
                step_hz: 1e6,
                time_s: f64::from(n) * 1e-3,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            })
            .collect();
        let mut samples = vec![Complex32::ZERO; pulses.len() * num_samples];
        for (n, row) in samples.chunks_exact_mut(num_samples).enumerate() {
            // The last sample decides.
            row[num_samples - 1].im = f32::from(u8::from(![4, 20].contains(&n)));
        }
        let collection = Collection {
            name: "scene".to_owned(),
            frame: SceneFrame::Local,
            pulses,
            num_samples,
            timed: true,
            extent: None,
        };
        InMemory::new(collection, samples).unwrap()
    }

    /// History whose samples are read on demand.
    struct OnDemand(InMemory);

    impl PhaseHistory for OnDemand {
        fn collection(&self) -> &Collection {
            self.0.collection()
        }

        fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
            self.0.read(pulses, samples)
        }
    }

    #[test]
    fn missing_and_zero_pulses_are_defects_with_warnings() {
        let examined = recording(5).with_pulse_defects();
        assert_eq!(
            examined.warnings(),
            [
                "scene: 3 pulses are missing in 1 gap of the pulse times, the first of 4 ms after pulse 9 at 0.009000 s (usual interval 1 ms): the image \
                 is normalised by the recorded pulses, and its side lobes rise",
                "scene: 2 of 40 pulses contain only zeros, the first is pulse 4: the normalisation of the image counts them",
            ]
        );
        assert_eq!(examined.defects().len(), 2);
    }

    /// Of 40 pulses of 2^18 samples, 32 are examined: `i * 40 / 32`, which include 20 (`i = 16`) but not 4 (5 follows 3.75). Pulse 20
    /// is number 21 of the file, and pulses left out by the reader are not missing.
    #[test]
    fn pulses_on_demand_are_examined_in_part() {
        let defects = pulse_defects(&OnDemand(recording(1 << 18)), &|n| n + 1).unwrap();
        let [defect] = &defects[..] else {
            panic!("{defects:?}");
        };
        assert_eq!(
            defect.to_string(),
            "1 of 32 pulses contain only zeros, the first is pulse 21, in 32 of 40 pulses"
        );
    }
}
