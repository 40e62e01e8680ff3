//! Moving targets (Schone 2020, 4.3): echoes and images by the plain sum along the targets' own paths.

use glam::DVec3;
use num_complex::Complex32;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::moving::{Moving, VelocityPlane, velocity_resolution_m_s};
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::Image;
use subaperture::phase_history::{Collection, InMemory, PhaseHistory, Pulse, Sweep, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};
use subaperture::track::Displacement;
use subaperture_tests::error_db;
use subaperture_tests::plain_history::{pixels_m, plain_pulse, plain_sum};
use subaperture_tests::plain_sum::unit_echo;
use subaperture_tests::subap::run;

/// Two-way path, less the reference, at pulse `pulse` to a target at `at`.
fn path_m(pulse: &Pulse, at: DVec3) -> f64 {
    plain_pulse(pulse, 1.0).relative_path_m(at.to_array())
}

/// Echo of one unit target at the position `at` of the time.
fn echo(collection: Collection, at: impl Fn(f64) -> DVec3) -> InMemory {
    let mut samples = Vec::new();
    for pulse in &collection.pulses {
        let path_m = path_m(pulse, at(pulse.time_s));
        for k in 0..collection.num_samples {
            let [re, im] = unit_echo(plain_pulse(pulse, 1.0).frequency_hz(k), path_m);
            samples.push(Complex32::new(re as f32, im as f32));
        }
    }
    InMemory::new(collection, samples).unwrap()
}

/// Matched-filter outputs for `count` targets, without windows. Target `i` is at `at(i, t)` at time `t`.
fn plain_values(
    history: &InMemory,
    count: usize,
    at: impl Fn(usize, f64) -> DVec3 + Sync,
) -> Vec<Complex32> {
    let collection = history.collection();
    let weights = Weights::new(collection, Window::None, Window::None);
    let sum = plain_sum(history, &weights);
    let values = sum.by_paths(count, |i, n, _| {
        let pulse = &collection.pulses[n];
        path_m(pulse, at(i, pulse.time_s))
    });
    let values = values.into_iter();
    values
        .map(|[re, im]| Complex32::new(re as f32, im as f32))
        .collect()
}

fn form(former: &dyn ImageFormer, history: &dyn PhaseHistory, grid: &ImageGrid) -> Image {
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let task = Task::new(history, grid, &weights);
    former.form(&task).unwrap().image
}

/// Image by the plain sum: positions on `grid` at time 0, with one displacement over time.
fn plain_image(
    history: &InMemory,
    grid: &ImageGrid,
    moved_m: impl Fn(f64) -> DVec3 + Sync,
) -> Image {
    let starts_m: Vec<DVec3> = pixels_m(grid).into_iter().collect();
    Image {
        rows: grid.rows.count,
        columns: grid.columns.count,
        pixels: plain_values(history, starts_m.len(), |i, t| starts_m[i] + moved_m(t)),
    }
}

fn peak_db(image: &Image) -> f64 {
    20.0 * f64::from(image.peak().unwrap().value.norm()).log10()
}

fn rdbp(mode: Mode, sub_cpi: Option<usize>) -> RangeDopplerBackprojection {
    RangeDopplerBackprojection {
        mode,
        error_db: -60.0,
        sub_cpi,
        patch_m: None,
    }
}

/// S 4.3: 5 m/s at 45 degrees from the scene's centre, on Table 4.1.
fn thesis_target() -> (InMemory, DVec3) {
    let velocity = DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0) * 5.0;
    let collection = Preset::Table41
        .simulate(&Variation::default())
        .collection()
        .clone();
    (echo(collection, |t| velocity * t), velocity)
}

#[test]
fn moving_target_focuses_only_at_its_velocity() {
    let (history, velocity) = thesis_target();
    // 3.5 m/s along the line of sight cause 3.5 / 125 * 5000 m = 141 m of displacement along the track: the
    // stationary image is searched for the peak there and everywhere between.
    let wide = "x=-180:180:0.4,y=-8:8:0.4".parse().unwrap();
    let still = peak_db(&form(&Backprojection { error_db: -50.0 }, &history, &wide));
    // 3.5 m/s along the track change the quadratic phase, 4 pi 65^2 / (2 R lambda) = 177 rad at the
    // aperture's ends, by 2 * 3.5 / 125: 10 rad, six times the pi / 2 at which focus is lost.
    println!("stationary hypothesis: peak at {still:.2} dB");
    assert!(still < -5.0, "{still}");

    let moving = Moving::new(&history, velocity, 0.0).unwrap();
    let grid: ImageGrid = "x=-2:2.1:0.37,y=-1:1.1:0.29".parse().unwrap();
    let oracle = plain_image(&history, &grid, |t| velocity * t);
    for (former, bound_db) in [
        (&Exact as &dyn ImageFormer, -110.0),
        (&Backprojection { error_db: -60.0 }, -60.0),
        (&rdbp(Mode::Precise, None), -60.0),
        (
            &PolarFormat {
                error_db: -60.0,
                centre_m: None,
            },
            -60.0,
        ),
        // The error of the thesis's method with 40 pulses, -18.7 dB on stationary scenes, consists of the scene's grating lobes, few of
        // which appear near a single target.
        (&rdbp(Mode::Thesis(Thesis::default()), Some(20)), -25.0),
    ] {
        let error = error_db(&form(former, &moving, &grid), &oracle);
        let point = "x=0:1:1,y=0:1:1".parse().unwrap();
        let peak = peak_db(&form(former, &moving, &point));
        println!("{}: error {error:.1} dB, peak {peak:.4} dB", former.name());
        assert!(error <= bound_db, "{}: {error}", former.name());
        assert!(peak.abs() < 0.1, "{}: {peak}", former.name());
    }
}

/// A car brakes from 12 m/s at 4 m/s^2 to 10 m/s in the first half second, diagonally to the line of sight.
#[test]
fn braking_target_focuses_only_along_its_motion() {
    const J_M_S2: f64 = 4.0;
    let direction = DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0);
    let moved_m = |t: f64| {
        direction
            * match t < 0.5 {
                true => 12.0 * t - 0.5 * J_M_S2 * t * t,
                false => 5.5 + 10.0 * (t - 0.5),
            }
    };
    let collection = Preset::Table41
        .simulate(&Variation::default())
        .collection()
        .clone();
    let last_s = collection.pulses.last().unwrap().time_s;
    let centre_hz = collection.pulses[0].frequency_hz(collection.num_samples / 2);
    let wavelength_m = SPEED_OF_LIGHT_M_S / centre_hz;
    let at_rest = echo(collection.clone(), |_| DVec3::ZERO);
    let history = echo(collection, moved_m);
    // Samples halfway between pulses, half a step beyond either end; none at the jump of acceleration.
    let sampled = |step_s: f64| {
        let count = (last_s / step_s).ceil() as u32 + 2;
        let times: Vec<f64> = (0..count).map(|n| (f64::from(n) - 0.5) * step_s).collect();
        let places: Vec<DVec3> = times.iter().map(|&t| moved_m(t)).collect();
        Displacement::sampled(times, &places).unwrap()
    };
    let bp = Backprojection { error_db: -60.0 };
    let point = "x=0:1:1,y=0:1:1".parse().unwrap();
    let rest_db = peak_db(&form(&bp, &at_rest, &point));

    let moving = Moving::new(&history, sampled(0.01), 0.0).unwrap();
    let loss_db = rest_db - peak_db(&form(&bp, &moving, &point));
    // The sum of unit vectors with phases within `phase_rad` of zero is at least cos(phase_rad), and bp is within 1e-3 in either image.
    let phase_rad = std::f64::consts::PI * J_M_S2 * 0.01 * 0.01 / wavelength_m;
    let bound_db = -20.0 * (phase_rad.cos() - 2e-3).log10();
    println!("samples every 10 ms: loss {loss_db:.4} dB, at most {bound_db:.4} dB");
    assert!(loss_db.abs() < bound_db && bound_db < 0.05, "{loss_db}");

    // The image at the mean velocity, 10.5 m/s, is searched for its peak. The radial velocity differs by up to 1.1 m/s from that of the
    // target, which displaces the peak by at most 1.1 / 125 * 5000 = 43 m along the track. The half of the pulses at constant velocity
    // focuses there: about -6 dB.
    let mean = Moving::new(&history, moved_m(last_s) / last_s, 0.0).unwrap();
    let wide = "x=-60:60:0.4,y=-4:4:0.4".parse().unwrap();
    let mean_db = rest_db - peak_db(&form(&Backprojection { error_db: -50.0 }, &mean, &wide));
    println!("mean velocity: loss {mean_db:.2} dB");
    assert!(mean_db > 3.0, "{mean_db}");

    // The error of interpolation decreases by 3.7 per sample, here per pulse, from both ends and to both sides of the jump: in total
    // less than that of five pulses, 5 / 1040 * 4e-4. The image's level is far above 1e-3: the sum is within 2e-3 of its error bound.
    let moving = Moving::new(&history, sampled(0.001), 0.0).unwrap();
    let grid: ImageGrid = "x=-2:2.1:0.37,y=-1:1.1:0.29".parse().unwrap();
    let oracle = plain_image(&history, &grid, moved_m);
    let error = error_db(&form(&bp, &moving, &grid), &oracle);
    println!("samples every 1 ms: error {error:.1} dB");
    assert!(error <= -59.9, "{error}");
}

#[test]
fn velocity_plane_peaks_at_target_velocity() {
    let (history, velocity) = thesis_target();
    let plane = VelocityPlane {
        position_m: DVec3::ZERO,
        epoch_s: 0.0,
        error_db: -60.0,
    };
    let resolution = |d| velocity_resolution_m_s(history.collection(), DVec3::ZERO, 0.0, d);
    let (tangential, radial) = (resolution(DVec3::X), resolution(DVec3::Y));
    println!("resolution {tangential:.3} m/s across, {radial:.4} m/s along the line of sight");
    let grid: ImageGrid = "x=1.5:5.5:0.1,y=3.45:3.63:0.003".parse().unwrap();
    let image = form(&plane, &history, &grid);
    let peak = image.peak().unwrap();
    let found = grid.position_m(peak.row, peak.column);
    println!("peak at {found}, {:.3} dB", peak_db(&image));
    assert!((found.x - velocity.x).abs() < tangential / 4.0, "{found}");
    assert!((found.y - velocity.y).abs() < radial / 4.0, "{found}");
    assert!(peak_db(&image).abs() < 0.1);

    // Some values of the plane against the plain sum.
    let coarse: ImageGrid = "x=3:4.2:0.23,y=3.52:3.55:0.0047".parse().unwrap();
    let got = form(&plane, &history, &coarse);
    let velocities: Vec<DVec3> = pixels_m(&coarse).into_iter().collect();
    let oracle = Image {
        pixels: plain_values(&history, velocities.len(), |i, t| velocities[i] * t),
        ..got.clone()
    };
    let error = error_db(&got, &oracle);
    println!("velocity plane: {error:.1} dB");
    assert!(error < -60.0, "{error}");

    // One resolution off in one direction, the response is at least 3 dB lower.
    let value = |v: DVec3| plain_values(&history, 1, |_, t| v * t)[0];
    let level = |v: DVec3| 20.0 * f64::from(value(v).norm()).log10();
    for step in [DVec3::X * tangential, DVec3::Y * radial] {
        assert!(level(velocity + step) < -3.0 && level(velocity - step) < -3.0);
    }
}

/// Figure 4.14: 50 m/s away from the radar, 1 GHz of bandwidth, 80 pulses of 0.1 ms in each sub-CPI. In one sub-CPI the target moves 0.4 m,
/// 2.7 range cells of 0.15 m.
#[test]
fn fast_target_needs_keystone() {
    let velocity = DVec3::new(0.0, 50.0, 0.0);
    let pulses = (0..800)
        .map(|n| {
            let at = DVec3::new((f64::from(n) - 399.5) * 0.0125, -1000.0, 0.0);
            Pulse {
                time_s: f64::from(n) * 1e-4,
                transmitter_m: at,
                receiver_m: at,
                reference_m: at + DVec3::Y * 1000.0,
                reference_path_m: 2000.0,
                start_hz: 9.5e9,
                step_hz: 1e9 / 256.0,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        })
        .collect();
    let collection = Collection {
        name: "fast".to_owned(),
        num_samples: 256,
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let start = DVec3::new(0.0, -2.0, 0.0);
    let history = echo(collection, |t| start + velocity * t);
    let moving = Moving::new(&history, velocity, 0.0).unwrap();
    let grid: ImageGrid = "x=-3:3.1:1,y=-2.6:-1.35:0.1".parse().unwrap();
    let oracle = plain_image(&history, &grid, |t| velocity * t);
    let result = |former: &dyn ImageFormer| {
        let image = form(former, &moving, &grid);
        let peak = peak_db(&image);
        let error = error_db(&image, &oracle);
        println!("{}: peak {peak:.2} dB, error {error:.1} dB", former.name());
        (peak, error)
    };
    let with = result(&rdbp(Mode::Thesis(Thesis::default()), Some(80)));
    let without_keystone = Mode::Thesis(Thesis {
        keystone: false,
        ..Thesis::default()
    });
    let without = result(&rdbp(without_keystone, Some(80)));
    let precise = result(&rdbp(Mode::Precise, None));
    // The mean of the range response sin(pi u) / (pi u) over +-1.33 cells: 0.40, -7.9 dB.
    assert!(
        (without.0 + 7.9).abs() < 1.0 && without.1 > -6.0,
        "{without:?}"
    );
    // The keystone resamples at 0.33 of 0.5 cycles per pulse and loses the edges of the sub-CPI: about -20 dB.
    assert!(with.0.abs() < 0.5 && with.1 < -15.0, "{with:?}");
    assert!(precise.0.abs() < 0.1 && precise.1 <= -60.0, "{precise:?}");
}

#[test]
fn command_focuses_on_given_velocity() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| run(folder.path(), line);
    run("simulate --preset table-4-1 -o s.cphd").succeeded();
    let grid = "--grid x=-4:4:0.5,y=-4:4:0.5";
    run(&format!("focus s.cphd -o still -q {grid}")).succeeded();
    run(&format!("focus s.cphd -o zero -q --velocity 0,0 {grid}")).succeeded();
    // 0.01 m/s away from the radar shifts a scatterer by 0.5 m: the scatterers of the scene stay in the grid.
    run(&format!(
        "focus s.cphd -o fast -q --velocity 0.5,-0.01,0 {grid}"
    ))
    .succeeded();
    // 1 m/s shifts all of them out of the grid. All pixels of so small an image are compared with the sum, so it keeps the bound although
    // it is dark.
    run(&format!(
        "focus s.cphd -a rdbp -o dark --velocity 5,-1.5,0 --check 256 {grid}"
    ))
    .succeeded();
    let bytes = |name: &str| std::fs::read(folder.path().join(name).join("image.npy")).unwrap();
    assert!(bytes("still") == bytes("zero") && bytes("still") != bytes("fast"));
    let json = |name: &str| -> serde_json::Value {
        let text = std::fs::read(folder.path().join(name).join("image.json")).unwrap();
        serde_json::from_slice(&text).unwrap()
    };
    let error_db = json("dark")["check"]["relative_to_image_db"]
        .as_f64()
        .unwrap();
    assert!(error_db < -60.0, "{error_db}");
    let velocity = &json("fast")["settings"]["given"]["velocity_m_s"];
    assert_eq!(*velocity, serde_json::json!([0.5, -0.01, 0.0]));

    // The scatterer at the scene's centre is stationary.
    let line = "velocity s.cphd --at 0,0 --vx -2:2.1:0.25 --vy -0.08:0.081:0.005 -o plane";
    let said = run(line).succeeded().to_owned();
    assert!(
        said.contains("brightest at v_x 0.000 m/s, v_y 0.000 m/s"),
        "{said}"
    );
    let plane = json("plane");
    assert_eq!(plane["velocities"]["columns"]["axis"], "v_x in m/s");
    assert_eq!(plane["velocities"]["rows"]["count"], 33);
    run("focus s.cphd -o x --no-keystone").failed(2, &["--no-keystone", "--mode thesis"]);
}
