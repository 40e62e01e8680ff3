//! Cuts through the impulse response: Schone 2020, Fig. 4.3.

use glam::DVec3;

use super::forming::{backprojection, form, grid_about, lone_scatterer, thesis};
use super::measure::{largest_difference_db, level_db, points_db};
use crate::{Check, Context, Finding, ItemError, Picture};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::Image;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_planner::grating::lobes;
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_simulate::PointTargetHistory;

/// Sub-CPI lengths of the cuts, pulses: 8, 10, 20 and 26 sub-CPIs.
const LENGTHS: [usize; 4] = [130, 104, 52, 40];
/// Sample spacing of a cut, metres: an eighth of the cross-range resolution.
pub(super) const CUT_STEP_M: f64 = 0.0625;
/// Half-length of a cut, metres.
pub(super) const CUT_M: f64 = 20.0;

/// Cuts through the image of one scatterer.
struct Cuts {
    simulated: PointTargetHistory,
    cross: ImageGrid,
    range: ImageGrid,
    /// Cuts in cross-range and in range for each of [`LENGTHS`].
    images: Vec<[Image; 2]>,
    /// Cuts by backprojection.
    traditional: [Image; 2],
}

/// Levels of grating lobes, dB.
struct Levels {
    /// 8 sub-CPIs, nearest and farthest lobe: relative to the main lobe, and to backprojection's sidelobes there.
    nearest: (f64, f64),
    farthest: (f64, f64),
    /// First lobe of 20 sub-CPIs relative to the second of 10 at the same position, measured and predicted from geometry.
    apart_db: f64,
    predicted_apart_db: f64,
}

impl Cuts {
    fn form(context: &Context) -> Result<Self, ItemError> {
        let simulated = lone_scatterer(DVec3::ZERO);
        let along = |x: bool| {
            let (half_x, half_y) = if x { (CUT_M, 0.0) } else { (0.0, CUT_M / 2.0) };
            grid_about(DVec3::ZERO, half_x, half_y, CUT_STEP_M)
        };
        let (cross, range) = (along(true), along(false));
        let mut images = Vec::new();
        for (length, index) in LENGTHS.into_iter().zip(0..) {
            let former = thesis(length);
            images.push([
                form(context, [2 * index, 10], &simulated, &cross, &former)?,
                form(context, [2 * index + 1, 10], &simulated, &range, &former)?,
            ]);
        }
        let traditional = [
            form(context, [8, 10], &simulated, &cross, &backprojection())?,
            form(context, [9, 10], &simulated, &range, &backprojection())?,
        ];
        Ok(Self {
            simulated,
            cross,
            range,
            images,
            traditional,
        })
    }

    /// Largest deviation of a range cut from backprojection's, dB.
    fn worst_range_db(&self) -> f64 {
        self.images
            .iter()
            .map(|[_, image]| largest_difference_db(image, &self.traditional[1]))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    fn levels(&self) -> Result<Levels, ItemError> {
        let placed = |length: usize, most: usize| {
            lobes(
                self.simulated.collection(),
                length,
                DVec3::ZERO,
                CUT_M,
                most,
            )
        };
        // 8 sub-CPIs: level of a lobe below the main lobe, and above backprojection's sidelobes there.
        let of_eight = placed(LENGTHS[0], 4);
        let [nearest, farthest] = [of_eight.first(), of_eight.last()].map(|lobe| {
            let place_m = lobe.map_or(f64::NAN, |lobe| lobe.cross_range_m);
            let level = level_db(&self.images[0][0], &self.cross, place_m);
            (
                level,
                level - level_db(&self.traditional[0], &self.cross, place_m),
            )
        });
        // The first lobe of 20 sub-CPIs has the position of the second of 10.
        let (of_ten, of_twenty) = (placed(LENGTHS[1], 2), placed(LENGTHS[2], 1));
        let (Some(second), Some(first)) = (of_ten.get(1), of_twenty.first()) else {
            return Err(ItemError::Measure(
                "no grating lobe within the cut".to_owned(),
            ));
        };
        let [level_ten, level_twenty] =
            [1, 2].map(|i| level_db(&self.images[i][0], &self.cross, first.cross_range_m));
        Ok(Levels {
            nearest,
            farthest,
            apart_db: level_twenty - level_ten,
            predicted_apart_db: second.level_db - first.level_db,
        })
    }

    fn chart(&self, title: &str, which: usize, axis: &Axis) -> Result<Vec<u8>, ItemError> {
        let names = LENGTHS.map(|length| format!("{} sub-CPIs of {length}", 1040 / length));
        let mut curves = vec![Curve {
            name: "backprojection".to_owned(),
            points: points_db(&self.traditional[which], axis),
            stroke: Stroke::Dashed,
        }];
        curves.extend(self.images.iter().zip(&names).map(|(image, name)| Curve {
            name: name.clone(),
            points: points_db(&image[which], axis),
            stroke: Stroke::Solid,
        }));
        Ok(lines(&Chart {
            title: title.to_owned(),
            across_label: format!("{title} (m)"),
            up_label: "level (dB)".to_owned(),
            curves,
            up: Some((-70.0, 0.0)),
            ..Chart::default()
        })?)
    }
}

fn checks(worst_range_db: f64, levels: &Levels) -> Vec<Check> {
    vec![
        Check::claim(
            "largest difference of a range cut from backprojection's, of the peak",
            "identical",
            format!("{worst_range_db:.1} dB"),
            worst_range_db < -30.0,
        ),
        Check::claim(
            "first lobe of 8 sub-CPIs",
            "slightly less than 4 dB below",
            format!("{:.1} dB", levels.nearest.0),
            (-4.0..-3.0).contains(&levels.nearest.0),
        ),
        Check::printed(
            "above backprojection's side lobes there",
            "25",
            levels.nearest.1,
            1,
            "dB",
        ),
        Check::claim(
            "outermost lobe of 8 sub-CPIs",
            "more than 25 dB below",
            format!("{:.1} dB", levels.farthest.0),
            levels.farthest.0 < -25.0,
        ),
        Check::printed(
            "above backprojection's side lobes there",
            "17",
            levels.farthest.1,
            1,
            "dB",
        ),
        Check::printed(
            "lobe of 20 against that of 10 at the same place",
            "-3",
            levels.apart_db,
            1,
            "dB",
        ),
    ]
}

pub(super) fn cuts(context: &Context) -> Result<Finding, ItemError> {
    let cuts = Cuts::form(context)?;
    let (worst_range_db, levels) = (cuts.worst_range_db(), cuts.levels()?);
    let checks = checks(worst_range_db, &levels);
    Ok(Finding {
        thesis: "Range cuts are the same for all sub-CPI lengths and for backprojection. In cross-range the first \
                 grating lobe of 8 sub-CPIs is slightly less than 4 dB below the main lobe and 25 dB above \
                 backprojection's side lobes, the leftmost more than 25 dB and about 17 dB. 20 sub-CPIs have their first \
                 at the place of the second of 10, 3 dB below it."
            .to_owned(),
        method: format!(
            "One scatterer at the centre, cuts through it with samples of {CUT_STEP_M} m. Geometry alone, without any \
             interpolation, predicts {:.1} dB between the two lobes that share a position. Scale: as in the thesis.",
            levels.predicted_apart_db
        ),
        why: Finding::unless_all_agree(
            &checks,
            "The thesis states whole decibels, one of them \"about\", of a figure; here the strongest pixel within half a metre of a lobe's place is \
             taken from both images.",
        ),
        checks,
        pictures: vec![
            Picture {
                name: "cross-range".to_owned(),
                caption: "Cuts in cross-range".to_owned(),
                png: cuts.chart("cross-range", 0, &cuts.cross.columns)?,
            },
            Picture {
                name: "range".to_owned(),
                caption: "Cuts in range".to_owned(),
                png: cuts.chart("range", 1, &cuts.range.rows)?,
            },
        ],
    })
}
