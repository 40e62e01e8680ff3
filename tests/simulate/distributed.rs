//! Distributed scenes: fast against plain sums with every kind of obstacle, and focused images against closed forms of speckle statistics, layover,
//! double bounce and shadow.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::Focusing;
use subaperture::focus::bp::Backprojection;
use subaperture::geometry::{Extent, ImageGrid};
use subaperture::image::Image;
use subaperture::radar::{Antenna, Motion, Pattern};
use subaperture::signal::window::Window;
use subaperture::simulate::Scatterer;
use subaperture::simulate::engine::{Engine, Method, Scratch, Sweep, View};
use subaperture::simulate::scenario::Scenario;
use subaperture::simulate::scene::{
    Block, Canopy, Facet, HeightFunction, Hill, MovingBlock, MovingPoint, Scene, Terrain,
    TerrainShadow, Vehicle,
};
use subaperture::track::{Pose, Trajectory};
use subaperture_tests::experiment::PAIR;

const C: f64 = 299_792_458.0;

#[derive(Clone, Copy, Debug)]
struct Flight;

impl Trajectory for Flight {
    fn pose(&self, time_s: f64) -> Pose {
        Pose {
            position_m: DVec3::new(125.0 * time_s - 60.0, -900.0, 300.0),
            attitude: DQuat::IDENTITY,
        }
    }
}

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    f64::from(random.next_u32()) / 2f64.powi(32) - 0.5
}

/// Hilly scene with points, a vehicle that moves, boxes and crowns of trees.
fn crowded() -> Scene {
    let extent = Extent {
        x_m: (-100.0, 100.0),
        y_m: (-100.0, 100.0),
    };
    let hills = HeightFunction {
        hills: vec![Hill {
            centre_m: DVec2::new(10.0, -30.0),
            height_m: 30.0,
            radius_m: 20.0,
        }],
        rms_m: 1.0,
        correlation_m: 25.0,
        ..HeightFunction::default()
    };
    let terrain = Terrain::sample("hills", &extent, 1.0, hills.prepare(3)).unwrap();
    let shadow = TerrainShadow::new(&terrain, &Flight, (0.0, 1.0), u64::MAX).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut place = |up_m: f64| {
        let at = DVec2::new(uniform(&mut random), uniform(&mut random)) * 190.0;
        at.extend(terrain.height_m(at) + up_m)
    };
    let mut scene = Scene::default();
    for i in 0..200 {
        let position_m = place(f64::from(i % 4));
        let amplitude = Complex64::cis(f64::from(i));
        scene.points.push(Scatterer {
            position_m,
            amplitude,
        });
    }
    for i in 0..20 {
        let centre_m = place(2.0);
        scene.blocks.push(Block {
            centre_m,
            half_m: DVec3::new(6.0, 2.0, 4.0),
            attitude: DQuat::from_rotation_z(f64::from(i)),
        });
        scene.canopies.push(Canopy {
            centre_m: place(5.0),
            half_m: DVec3::new(4.0, 4.0, 5.0),
            attenuation_db_m: 0.7,
        });
        let velocity_m_s = DVec3::new(-3.0, f64::from(i % 5), 0.0);
        let start = Scatterer {
            position_m: place(0.5),
            amplitude: Complex64::I,
        };
        scene.moving_points.push(MovingPoint {
            start,
            velocity_m_s,
        });
        scene.facets.push(Facet {
            start,
            velocity_m_s,
            normal: (i % 3 > 0).then(|| DVec2::from_angle(f64::from(i))),
            width_rad: 0.6,
        });
    }
    let car = Vehicle {
        position_m: place(0.0),
        size_m: DVec3::new(5.0, 2.0, 1.6),
        heading_rad: 0.4,
        speed_m_s: 15.0,
        epoch_s: 0.3,
        cross_section_m2: 20.0,
        flash_rad: 0.3,
    };
    scene.facets.extend(car.facets(1, 0).unwrap());
    let moving: MovingBlock = car.block();
    scene.moving_blocks.push(moving);
    scene.terrain_shadow = Some(Arc::new(shadow));
    scene
}

#[test]
fn fast_sum_keeps_bound_with_terrain_obstacles_and_vehicles() {
    let antenna = |x: f64, pattern: Pattern| Antenna {
        name: "a".into(),
        offset_m: DVec3::X * x,
        boresight: DVec3::new(0.0, 0.9, -0.3).normalize(),
        up: DVec3::new(0.0, 0.3, 0.9).normalize(),
        aim_m: None,
        pattern,
    };
    let one = antenna(0.0, Pattern::Isotropic);
    let two = antenna(0.4, Pattern::Isotropic);
    let scene = crowded();
    let open = Scene {
        blocks: Vec::new(),
        moving_blocks: Vec::new(),
        canopies: Vec::new(),
        terrain_shadow: None,
        ..scene.clone()
    };
    for motion in [Motion::StopAndGo, Motion::True] {
        for receiver in [&one, &two] {
            let view = View {
                body: &Flight,
                transmitter: &one,
                receiver,
                time_s: 0.4,
                sweep: Sweep {
                    start_hz: 9.525e9,
                    step_hz: 0.5e6,
                    count: 300,
                    start_s: 2e-6,
                    step_s: 1e-3 / 300.0,
                    residual_hz_s: 1.5e11,
                },
                reference_s: 2.0 * 900.0 / C,
                motion,
                spreading_from_m: Some(950.0),
            };
            let samples = |scene: &Scene, method: Method| {
                let mut out = vec![Complex64::ZERO; 300];
                Engine::new(scene, method).pulse(&view, &mut Scratch::default(), &mut out);
                out
            };
            let energy = |z: &[Complex64]| z.iter().map(|z| z.norm_sqr()).sum::<f64>();
            let [fast, plain] = [Method::Fast, Method::Sum].map(|method| samples(&scene, method));
            let off: Vec<Complex64> = fast.iter().zip(&plain).map(|(a, b)| a - b).collect();
            let error_db = 10.0 * (energy(&off) / energy(&plain)).log10();
            println!("{motion:?}: {error_db:.1} dB");
            assert!(error_db < -90.0, "{motion:?}: {error_db}");
            // The obstacles matter: they take between a tenth and nine tenths of the energy.
            let left = energy(&plain) / energy(&samples(&open, Method::Sum));
            assert!((0.1..0.9).contains(&left), "{left}");
        }
    }
}

/// Image of a scenario on a grid, with a window of -35 dB side lobes.
fn focus(scenario: &str, grid: &str) -> (Image, ImageGrid) {
    let experiment = Scenario::new("scene.toml", scenario, ".")
        .experiment()
        .unwrap_or_else(|error| panic!("{error}"));
    let recording = experiment.record(PAIR).unwrap();
    let grid: ImageGrid = grid.parse().unwrap();
    let window = Window::default();
    let former = Backprojection::default().error_db(-40.0);
    let focused = Focusing::new(&recording, &grid)
        .windows(window, window)
        .by(&former)
        .unwrap();
    (focused.image, grid)
}

#[test]
fn pixel_intensities_have_moments_of_exponential_and_k_distributions() {
    // 75 MHz: 2 m in range; 15 m of track at 2 km: 2 m across. 400 m of scene need pulses at most 0.075 m apart: 200.
    let scenario = |texture: &str| {
        format!(
            r#"
            [scene]
            [[scene.clutter]]
            x = "-200, 200 m"
            y = "-200, 200 m"
            density = 1
            sigma0 = "-10 dB"
            {texture}
            [radar]
            kind = "ideal"
            pulses = 220
            pri = "1 ms"
            centre = "10 GHz"
            bandwidth = "75 MHz"
            samples = 300
            [platform]
            kind = "linear"
            position = "0, -2000, 100 m"
            velocity = "70, 0, 0 m/s"
            "#
        )
    };
    let moments = |texture: &str| {
        let (image, _) = focus(&scenario(texture), "x=-190:190:4,y=-190:190:4");
        let mean = |n: i32| {
            let powers = image.pixels.iter().map(|z| f64::from(z.norm_sqr()).powi(n));
            powers.sum::<f64>() / image.pixels.len() as f64
        };
        (mean(1), mean(2) / mean(1).powi(2))
    };
    // 96 x 96 pixels, wider apart than the 3 m of the windowed resolution: independent. Exponential intensity has <I^2> = 2 and a standard
    // error of sqrt(20 / 9216) = 0.047 (with the mean's fluctuation less): 4 of them. Points of Gaussian amplitude, 4 per 2 m cell, add
    // their number's fluctuation to the power of a cell: at most 2 / (1 x 9 m^2) = 0.2.
    let (_, plain) = moments("");
    assert!((1.8..2.4).contains(&plain), "{plain}");
    // nu = 1: 2 (1 + 1 / nu) = 4. The texture's own mean square, 2, has the standard error sqrt(20 / 920) = 0.15 with one independent value per
    // pi L^2 / 2 = 157 m^2: twice that, 0.3, and sqrt((576 - 16) / 9216) = 0.25 of the speckle: 0.39, three of them. A variation within
    // cells of 3 m takes (3 / 10)^2 = 9 % of the excess of 2.
    let (_, textured) = moments("texture_shape = 1\ntexture_length = \"10 m\"");
    assert!((3.8 - 1.2..4.0 + 1.2).contains(&textured), "{textured}");
}

#[test]
fn building_has_layover_double_bounce_and_shadow_at_closed_form_places() {
    // A house 20 m wide, 10 m deep and 8 m high, seen from the south at 45 degrees. 300 MHz: 0.5 m in slant range, 0.71 m on the ground;
    // 42 m of track at 1.41 km: 0.5 m across.
    let scenario = r#"
        [scene]
        [[scene.clutter]]
        x = "-30, 30 m"
        y = "-40, 40 m"
        density = 12
        sigma0 = "-12 dB"
        [[scene.building]]
        position = "0, 0, 0 m"
        size = "20, 10, 8 m"
        spacing = "0.25 m"
        wall = "-20 dB"
        edge = "-3 dB"
        foot = "3 dB"
        [radar]
        kind = "ideal"
        pulses = 256
        pri = "1 ms"
        centre = "10 GHz"
        bandwidth = "300 MHz"
        samples = 256
        [platform]
        kind = "linear"
        position = "0, -1000, 1000 m"
        velocity = "165, 0, 0 m/s"
        "#;
    let (image, grid) = focus(scenario, "x=-8:8:0.5,y=-30:30:0.2");
    let columns = grid.columns.count;
    // Mean power of each row, over 16 m of the building's 20 m of width.
    let profile: Vec<(f64, f64)> = (0..grid.rows.count)
        .map(|row| {
            let pixels = &image.pixels[row * columns..][..columns];
            let power: f64 = pixels.iter().map(|z| f64::from(z.norm_sqr())).sum();
            (grid.rows.at(row), power / columns as f64)
        })
        .collect();
    let mean = |from: f64, to: f64| {
        let within = profile.iter().filter(|(y, _)| (from..to).contains(y));
        let powers: Vec<f64> = within.map(|(_, power)| *power).collect();
        powers.iter().sum::<f64>() / powers.len() as f64
    };
    let peak = |from: f64, to: f64| {
        let within = profile.iter().filter(|(y, _)| (from..to).contains(y));
        *within.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
    };
    let clutter = mean(-29.0, -16.0);
    // Ground of equal range to the top of the front wall (y = -5, z = 8): layover of 8 / tan 45 = 8 m towards the radar.
    let range_m = f64::hypot(1000.0 - 5.0, 1000.0 - 8.0);
    let layover_m = (range_m * range_m - 1e6).sqrt() - 1000.0;
    assert!((layover_m + 13.0).abs() < 0.1, "{layover_m}");
    // Lines lie within half a cell of 1 m (0.71 m, widened by the window) of their places.
    let (edge_m, edge) = peak(-15.0, -11.0);
    assert!((edge_m - layover_m).abs() < 0.5, "{edge_m}");
    let (foot_m, foot) = peak(-8.0, -3.5);
    assert!((foot_m + 5.0).abs() < 0.5, "{foot_m}");
    // The edge's -3 dB per metre over a cell of 1 m is 9 dB above the clutter, the foot's 6 dB is 18 dB above; speckle along 16 m, 24 cells,
    // has a standard deviation of 20 %.
    assert!(
        edge > 3.0 * clutter && foot > 25.0 * clutter,
        "{edge} {foot} {clutter}"
    );
    // Side lobes of the foot, -35 dB, are 20 dB below the clutter, those of the rear edge 26 dB.
    // Behind: the line over the rear edge (y = 5, z = 8) meets the ground at 8 tan 45 = 8 m behind it; the image of that edge lies at -3.
    let end_m = -1000.0 + 1005.0 * 1000.0 / 992.0;
    let shadow = mean(0.0, end_m - 1.0);
    let depth_db = 10.0 * (clutter / shadow).log10();
    println!("layover {edge_m:.2} of {layover_m:.2}, foot {foot_m:.2}, shadow {depth_db:.1} dB");
    assert!(depth_db > 15.0, "{depth_db}");
    // The end of the shadow: half of the clutter's power within a cell of 1 m.
    let end = profile
        .iter()
        .find(|(y, power)| *y > 2.0 && *power > 0.5 * clutter)
        .unwrap();
    assert!((end.0 - end_m).abs() < 1.0, "{} of {end_m}", end.0);
    let behind = mean(end_m + 1.0, 29.0);
    assert!((behind / clutter - 1.0).abs() < 0.2, "{behind} {clutter}");
}

#[test]
fn ridge_of_terrain_hides_points_until_the_radar_sees_over_it() {
    // A ridge along y with its crest at x = 0, 10 m high and 20 m wide, and a point on the ground 20 m to its east. The radar flies east, 300 m
    // high, 800 m to the south: the line to the point crosses x = 0 where t = 20 / (20 - X) of it is covered, at the height 300 t, which exceeds
    // 10 m for t > 1/30, X > -580 m. Before, it is hidden.
    let extent = Extent {
        x_m: (-60.0, 60.0),
        y_m: (-60.0, 60.0),
    };
    let roof = |at: DVec2| (10.0 - at.x.abs()).max(0.0);
    let terrain = Terrain::sample("a roof", &extent, 1.0, roof).unwrap();
    #[derive(Debug)]
    struct East;
    impl Trajectory for East {
        fn pose(&self, time_s: f64) -> Pose {
            Pose {
                position_m: DVec3::new(100.0 * time_s, -800.0, 300.0),
                attitude: DQuat::IDENTITY,
            }
        }
    }
    let shadow = TerrainShadow::new(&terrain, &East, (-12.0, 0.0), u64::MAX).unwrap();
    let point_m = DVec3::new(20.0, 0.0, 0.0);
    // A quarter of a node of the crest, 0.25 m of 10 m, and a quarter of a movement between maps: 5 % of 600 m.
    assert!(shadow.at(-6.3).hides(point_m) && shadow.at(-11.0).hides(point_m));
    assert!(!shadow.at(-5.4).hides(point_m) && !shadow.at(-2.0).hides(point_m));
}
