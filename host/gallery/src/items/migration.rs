//! Range migration, and its correction by the Keystone transform: Schone 2020, Table 2.1, Figs 2.2 and 2.3.

use num_complex::Complex32;

use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Axis;
use subaperture_model::phase_history::{Band, PhaseHistory};
use subaperture_module::range_doppler::RangeDopplerMapper;
use subaperture_plot::{Colours, HeatMap, heat};
use subaperture_simulate::{PointTargetHistory, Preset, Variation};

pub(super) const ITEMS: [Item; 3] = [
    Item {
        id: "s-table-2-1",
        source: "Schone 2020, Table 2.1",
        title: "A target that migrates through range",
        work: 0.098,
        reproduce: table,
    },
    Item {
        id: "s-2-2",
        source: "Schone 2020, Fig. 2.2",
        title: "Range migration, and the range-Doppler map that it blurs",
        work: 1.2,
        reproduce: unfocused,
    },
    Item {
        id: "s-2-3",
        source: "Schone 2020, Fig. 2.3",
        title: "Keystone undoes range migration",
        work: 0.91,
        reproduce: focused,
    },
];

/// Range bins per frequency.
const RANGE_PADDING: usize = 8;
/// Range interval shown, metres to either side of the reference.
const SHOWN_M: f64 = 6.0;
/// Decimation of the pulses shown.
const SHOWN_PULSES: usize = 4;
/// Doppler interval shown, hertz to either side of the target.
const SHOWN_HZ: f64 = 40.0;

/// Simulated pulses and their collection.
struct Pass {
    simulated: PointTargetHistory,
    band: Band,
    samples: Vec<Complex32>,
    pri_s: f64,
}

/// Levels relative to the largest over two axes, dB: rows `up`, columns `across`.
struct Levels {
    values: Vec<f32>,
    up: Axis,
    across: Axis,
}

impl Pass {
    fn new() -> Result<Self, ItemError> {
        let simulated = Preset::Table21.simulate(&Variation::default());
        let collection = simulated.collection();
        let band = collection
            .band()
            .ok_or_else(|| ItemError::Measure("pulses do not share a band".to_owned()))?;
        let mut samples = vec![Complex32::ZERO; collection.pulses.len() * band.count];
        simulated.read(0..collection.pulses.len(), &mut samples)?;
        let pri_s = collection.pulses[1].time_s - collection.pulses[0].time_s;
        Ok(Self {
            band,
            samples,
            pri_s,
            simulated,
        })
    }

    fn num_pulses(&self) -> usize {
        self.simulated.collection().pulses.len()
    }

    /// Range of the target at a pulse, metres from the reference.
    fn range_m(&self, pulse: usize) -> f64 {
        let pulse = &self.simulated.collection().pulses[pulse];
        pulse.relative_path_m(self.simulated.scatterers()[0].position_m) / 2.0
    }

    fn migration_m(&self) -> f64 {
        self.range_m(self.num_pulses() - 1) - self.range_m(0)
    }

    /// Doppler shift of the target at the band centre, hertz; approach is positive.
    fn doppler_hz(&self) -> f64 {
        let rate_m_s = self.migration_m() / ((self.num_pulses() - 1) as f64 * self.pri_s);
        -2.0 * rate_m_s * self.band.centre_hz() / SPEED_OF_LIGHT_M_S
    }

    fn range_axis(&self) -> Axis {
        let count = self.band.count * RANGE_PADDING;
        let step = self.band.unambiguous_path_m() / 2.0 / count as f64;
        Axis {
            start: -((count / 2) as f64) * step,
            step,
            count,
        }
    }

    /// Range-Doppler map about the target.
    fn shown(&self, map: &Levels, name: &str, caption: &str) -> Result<Picture, ItemError> {
        let middle = self.doppler_hz();
        let up = (middle - SHOWN_HZ, middle + SHOWN_HZ);
        map.picture(name, caption, up, (-SHOWN_M, SHOWN_M), "Doppler (Hz)")
    }

    /// Range-Doppler maps of `slow` pulses each, in the layout of [`RangeDopplerMapper`].
    fn maps(&self, band: &Band, slow: usize, doppler_bins: usize) -> Vec<Complex32> {
        let bins = self.range_axis().count;
        let fast = vec![1.0; self.band.count];
        let mut mapper = RangeDopplerMapper::new(band, &fast, &vec![1.0; slow], bins, doppler_bins);
        let mut maps = vec![Complex32::ZERO; self.num_pulses() / slow * doppler_bins * bins];
        maps.chunks_exact_mut(doppler_bins * bins)
            .zip(self.samples.chunks_exact(slow * self.band.count))
            .for_each(|(map, pulses)| mapper.map(pulses, map));
        maps
    }

    /// Range profiles, decimated for the picture.
    fn profiles(&self) -> Levels {
        let up = Axis {
            start: 0.0,
            step: SHOWN_PULSES as f64,
            count: self.num_pulses() / SHOWN_PULSES,
        };
        let bins = self.range_axis().count;
        let all = self.maps(&self.band, 1, 1);
        let shown: Vec<Complex32> = all
            .chunks_exact(bins)
            .step_by(SHOWN_PULSES)
            .flatten()
            .copied()
            .collect();
        Levels::of(&shown, up, self.range_axis())
    }

    /// Range-Doppler map of the whole CPI. Without Keystone, the Doppler axis is that of the reference frequency
    /// for all frequencies.
    fn map(&self, keystone: bool) -> Levels {
        let narrow = Band {
            start_hz: self.band.centre_hz(),
            step_hz: 0.0,
            ..self.band
        };
        let band = if keystone { &self.band } else { &narrow };
        let num_pulses = self.num_pulses();
        let bins = 2 * num_pulses;
        let step = 1.0 / (self.pri_s * bins as f64);
        let up = Axis {
            start: -((bins / 2) as f64) * step,
            step,
            count: bins,
        };
        Levels::of(&self.maps(band, num_pulses, bins), up, self.range_axis())
    }
}

impl Levels {
    fn of(values: &[Complex32], up: Axis, across: Axis) -> Self {
        Self {
            values: values.iter().map(|z| z.norm_sqr()).collect(),
            up,
            across,
        }
    }

    /// Largest power; 1 for a target without loss.
    fn peak_db(&self) -> f64 {
        let peak = self.values.iter().copied().fold(0.0, f32::max);
        10.0 * f64::from(peak).log10()
    }

    /// Horizontal extent of values within 3 dB of the peak.
    fn width_across(&self) -> f64 {
        let peak = self.values.iter().copied().fold(0.0, f32::max);
        let (mut first, mut last) = (usize::MAX, 0);
        for (i, &value) in self.values.iter().enumerate() {
            if value >= 0.5 * peak {
                first = first.min(i % self.across.count);
                last = last.max(i % self.across.count);
            }
        }
        (last - first + 1) as f64 * self.across.step
    }

    /// Picture of the part within `up` and `across`.
    fn picture(
        &self,
        name: &str,
        caption: &str,
        up: (f64, f64),
        across: (f64, f64),
        up_label: &str,
    ) -> Result<Picture, ItemError> {
        let inside = |axis: &Axis, (low, high): (f64, f64)| {
            let first = ((low - axis.start) / axis.step).ceil().max(0.0) as usize;
            let last = ((high - axis.start) / axis.step).floor() as usize;
            first.min(axis.count - 1)..(last + 1).min(axis.count)
        };
        let (rows, columns) = (inside(&self.up, up), inside(&self.across, across));
        let part = |axis: &Axis, range: &std::ops::Range<usize>| Axis {
            start: axis.at(range.start),
            step: axis.step,
            count: range.len(),
        };
        let values: Vec<f32> = rows
            .clone()
            .flat_map(|row| {
                let line = &self.values[row * self.across.count..(row + 1) * self.across.count];
                line[columns.clone()]
                    .iter()
                    .map(|power| 10.0 * power.log10())
            })
            .collect();
        let png = heat(&HeatMap {
            values: &values,
            rows: part(&self.up, &rows),
            columns: part(&self.across, &columns),
            title: caption.to_owned(),
            across_label: "range from the reference (m)".to_owned(),
            up_label: up_label.to_owned(),
            unit: "dB".to_owned(),
            range: (-40.0, 0.0),
            colours: Colours::default(),
            proportional: false,
        })?;
        Ok(Picture {
            name: name.to_owned(),
            caption: caption.to_owned(),
            png,
        })
    }
}

fn table(_: &Context) -> Result<Finding, ItemError> {
    let pass = Pass::new()?;
    let duration_s = pass.num_pulses() as f64 * pass.pri_s;
    let resolution_m = SPEED_OF_LIGHT_M_S / (2.0 * pass.band.bandwidth_hz());
    Ok(Finding {
        thesis: "400 MHz, PRI 0.5 ms, 1024 pulses, 5 km, 10 m/s: the target migrates by 5.12 m over a CPI \
                 of 5.12 s (caption of Fig. 2.2), at a range resolution of 0.375 m."
            .to_owned(),
        method: "The table simulated, with a carrier of 10 GHz as in Table 4.1 (the table gives none). Scale: as in the thesis."
            .to_owned(),
        checks: vec![
            Check::printed("migration", "5.12", pass.migration_m(), 3, "m"),
            Check::printed("range resolution", "0.375", resolution_m, 4, "m"),
            Check::printed("length of the CPI", "5.12", duration_s, 3, "s"),
        ],
        why: Some(
            "1024 pulses of 0.5 ms last 0.512 s, in which 10 m/s make 5.12 m: the table and the migration \
             agree, the caption's 5.12 s is a slip."
                .to_owned(),
        ),
        pictures: vec![],
    })
}

fn unfocused(_: &Context) -> Result<Finding, ItemError> {
    let pass = Pass::new()?;
    let map = pass.map(false);
    let cells = pass.migration_m() * 2.0 * pass.band.bandwidth_hz() / SPEED_OF_LIGHT_M_S;
    Ok(Finding {
        thesis: "The target's range changes over several range bins during the CPI, and its energy is spread \
                 over many range-Doppler bins."
            .to_owned(),
        method: "Range profiles of all pulses, and a Doppler FFT over the whole CPI. Scale: as in the thesis.".to_owned(),
        checks: vec![
            Check::claim(
                "range cells that the target crosses",
                "several",
                format!("{cells:.1}"),
                cells > 3.0,
            ),
            Check::claim(
                "extent in range within 3 dB of the map's peak, against a resolution of 0.375 m",
                "several cells",
                format!("{:.2} m", map.width_across()),
                map.width_across() > 3.0 * 0.375,
            ),
            Check::claim(
                "peak of the map, 0 dB being a focused target",
                "poor",
                format!("{:.1} dB", map.peak_db()),
                map.peak_db() < -6.0,
            ),
        ],
        why: None,
        pictures: vec![
            pass.profiles().picture(
                "migration",
                "Range profiles",
                (0.0, pass.num_pulses() as f64),
                (-SHOWN_M, SHOWN_M),
                "pulse",
            )?,
            pass.shown(&map, "map", "Range-Doppler map, no Keystone")?,
        ],
    })
}

fn focused(_: &Context) -> Result<Finding, ItemError> {
    let pass = Pass::new()?;
    let map = pass.map(true);
    Ok(Finding {
        thesis:
            "The Keystone transform fully corrects linear range migration: the target is one point."
                .to_owned(),
        method:
            "The same pulses; the Doppler transform on an axis scaled with frequency, which is \
                 the Keystone transform without resampling. Scale: as in the thesis."
                .to_owned(),
        checks: vec![
            // The nearest bin lies within a quarter of a Doppler cell and a sixteenth of a range cell of the
            // target: sin(pi u) / (pi u) there loses up to 0.91 and 0.06 dB.
            Check::claim(
                "peak of the map, 0 dB being focused",
                "one point",
                format!("{:.2} dB", map.peak_db()),
                map.peak_db().abs() <= 0.97,
            ),
            // 0.886 of the resolution is an unweighted band's width, and a bin is an eighth of it.
            Check::number(
                "extent in range within 3 dB",
                0.886 * 0.375,
                map.width_across(),
                map.across.step,
                2,
                "m",
            ),
        ],
        why: None,
        pictures: vec![pass.shown(&map, "map", "Range-Doppler map after Keystone")?],
    })
}
