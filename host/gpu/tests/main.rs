//! Images formed by a GPU, or by a Vulkan driver on the processor, against the exact sum.

use std::f64::consts::TAU;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_focus::bp::Backprojection;
use subaperture_focus::device::{
    Device, DeviceError, Expansion, PatchSums, ProfileBlock, TileSums, rounding,
};
use subaperture_focus::exact::Exact;
use subaperture_focus::rdbp::RangeDopplerBackprojection;
use subaperture_focus::{FormError, Formed, ImageFormer, Numerics, Task};
use subaperture_gpu::{Gpu, Kind};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::Image;
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{Collection, PhaseHistory, Pulse, Sweep, Weights};
use subaperture_signal::window::Window;
use subaperture_simulate::{PointTargetHistory, Preset, Scatterer, Variation};

/// The device, opened once. `None` without any driver; the test is then reported as skipped.
fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    let open = || match Gpu::open(Kind::Any) {
        Ok(gpu) => {
            println!(
                "{}: {:.2} ns per pixel and pulse",
                gpu.name(),
                gpu.pixel_ns()
            );
            Some(gpu)
        }
        Err(error) => {
            println!("skipped: {error}");
            None
        }
    };
    let gpu = GPU.get_or_init(open);
    if gpu.is_none() {
        println!("skipped: no driver");
    }
    gpu.as_ref()
}

struct Bench {
    history: PointTargetHistory,
    grid: ImageGrid,
    weights: Weights,
}

impl Bench {
    fn new(history: PointTargetHistory, grid: &str) -> Self {
        let weights = Weights::new(history.collection(), Window::Hamming, Window::Hamming);
        Self {
            history,
            grid: grid.parse().unwrap(),
            weights,
        }
    }

    fn task<'a>(&'a self, device: Option<&'a dyn Device>) -> Task<'a> {
        Task {
            memory_bytes: 1 << 30,
            monitor: &Silent,
            numerics: Numerics {
                device,
                ..Numerics::default()
            },
            ..Task::new(&self.history, &self.grid, &self.weights)
        }
    }

    fn form(&self, former: &dyn ImageFormer, device: Option<&dyn Device>) -> Formed {
        former.form_best(&self.task(device)).unwrap()
    }

    /// Error against the exact sum with the bound asked for.
    fn error_db(&self, bound_db: f64, device: &dyn Device) -> f64 {
        let exact = self.form(&Exact, None).image;
        let formed = self.form(&Backprojection { error_db: bound_db }, Some(device));
        assert_eq!(formed.settings["device"], device.name());
        assert!(!formed.bound_missed);
        relative_db(&formed.image, &exact)
    }
}

fn relative_db(image: &Image, reference: &Image) -> f64 {
    let (mut error, mut power) = (0.0, 0.0);
    for (a, b) in image.pixels.iter().zip(&reference.pixels) {
        error += f64::from((a - b).norm_sqr());
        power += f64::from(b.norm_sqr());
    }
    10.0 * (error / power).log10()
}

/// Fifteen scatterers at 10 GHz from a bent bistatic track at the given distance.
fn bent_track(distance_m: f64, num_pulses: usize, extent_m: f64) -> PointTargetHistory {
    let pulse = |n: usize| {
        let along = n as f64 / num_pulses as f64 - 0.5;
        let bend_m = 3.0 * (TAU * along).sin();
        let transmitter_m = DVec3::new(
            0.06 * distance_m * along,
            -0.8 * distance_m + bend_m,
            0.6 * distance_m,
        );
        let receiver_m = transmitter_m + DVec3::new(0.02 * distance_m, 1.0, -2.0);
        Pulse {
            time_s: n as f64,
            transmitter_m,
            receiver_m,
            reference_m: DVec3::ZERO,
            reference_path_m: transmitter_m.length() + receiver_m.length(),
            start_hz: 9.7e9,
            step_hz: 600e6 / 512.0,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    let collection = Collection {
        name: "bent track".to_owned(),
        num_samples: 512,
        pulses: (0..num_pulses).map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let scatterer = |i: u32| {
        let turn = TAU * f64::from(i) * 0.618_034;
        let radius = extent_m * (f64::from(i) / 15.0).sqrt();
        Scatterer {
            position_m: DVec3::new(radius * turn.cos(), radius * turn.sin(), 0.0),
            amplitude: Complex64::cis(f64::from(i)),
        }
    };
    PointTargetHistory::new(collection, (0..15).map(scatterer).collect(), None)
}

#[test]
fn image_keeps_each_bound() {
    let Some(gpu) = gpu() else { return };
    let bench = Bench::new(bent_track(10e3, 150, 15.0), "x=-16:16:0.2,y=-14:14:0.2");
    for bound_db in [-40.0, -60.0, -70.0, -80.0] {
        let error_db = bench.error_db(bound_db, gpu);
        println!("asked {bound_db} dB: {error_db:.1} dB");
        assert!(error_db <= bound_db, "{bound_db}: {error_db}");
    }
}

/// The device, counting the tiles and pulses that it adds.
#[derive(Debug)]
struct Counting<'a> {
    gpu: &'a Gpu,
    added: AtomicUsize,
    patches: AtomicUsize,
}

struct CountingSums<'a> {
    sums: Box<dyn TileSums + 'a>,
    added: &'a AtomicUsize,
}

impl<'a> Counting<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        Self {
            gpu,
            added: AtomicUsize::new(0),
            patches: AtomicUsize::new(0),
        }
    }
}

impl Device for Counting<'_> {
    fn name(&self) -> &str {
        self.gpu.name()
    }

    fn pixel_ns(&self) -> f64 {
        self.gpu.pixel_ns()
    }

    fn start<'a>(&'a self, tiles: &[[usize; 2]]) -> Result<Box<dyn TileSums + 'a>, DeviceError> {
        Ok(Box::new(CountingSums {
            sums: self.gpu.start(tiles)?,
            added: &self.added,
        }))
    }

    fn start_patch<'a>(
        &'a self,
        stations: usize,
        lines: usize,
    ) -> Result<Box<dyn PatchSums + 'a>, DeviceError> {
        self.patches.fetch_add(1, Ordering::Relaxed);
        self.gpu.start_patch(stations, lines)
    }
}

impl TileSums for CountingSums<'_> {
    fn load(&mut self, block: &ProfileBlock) -> Result<(), DeviceError> {
        self.sums.load(block)
    }

    fn add(&mut self, tiles: &[usize], paths: &[Expansion]) -> Result<(), DeviceError> {
        self.added.fetch_add(paths.len(), Ordering::Relaxed);
        self.sums.add(tiles, paths)
    }

    fn wait(&mut self) -> Result<(), DeviceError> {
        self.sums.wait()
    }

    fn take(self: Box<Self>) -> Result<Vec<Complex32>, DeviceError> {
        self.sums.take()
    }
}

/// A short track above the scene: the paths to tiles below it bend too much for the device.
#[test]
fn tiles_that_do_not_suit_the_device_are_added_by_the_processor() {
    let Some(gpu) = gpu() else { return };
    let mut history = bent_track(10e3, 70, 12.0).collection().clone();
    for (n, pulse) in history.pulses.iter_mut().enumerate() {
        let antenna_m = DVec3::new(0.2 * n as f64 - 7.0, 1.0, 90.0);
        pulse.transmitter_m = antenna_m;
        pulse.receiver_m = antenna_m;
        pulse.reference_path_m = 2.0 * antenna_m.length();
    }
    let scatterer = Scatterer {
        position_m: DVec3::new(1.0, 2.0, 0.0),
        amplitude: Complex64::ONE,
    };
    // Tiles of this grid are not multiples of the shader's groups.
    let bench = Bench::new(
        PointTargetHistory::new(history, vec![scatterer], None),
        "x=-150:150.6:0.2,y=-3.2:3.4:0.2",
    );
    let counting = Counting::new(gpu);
    let error_db = bench.error_db(-60.0, &counting);
    let added = counting.added.into_inner();
    println!("{added} tiles and pulses, {error_db:.1} dB");
    assert!(error_db <= -60.0, "{error_db}");
    // All would be 70 pulses times 94 x 3 tiles of at most 16 pixels a side.
    assert!(added > 0 && added < 70 * 94 * 3, "{added}");
}

#[test]
fn thesis_scene_keeps_70_db() {
    let Some(gpu) = gpu() else { return };
    let history = Preset::Table41.simulate(&Variation::default());
    let bench = Bench::new(history, "x=-20:20:0.25,y=-20:20:0.25");
    let error_db = bench.error_db(-70.0, gpu);
    println!("Table 4.1: {error_db:.1} dB");
    assert!(error_db <= -70.0, "{error_db}");
}

/// Some pixels of the image, by the defining sum in float64.
fn defining_sum(bench: &Bench, pixels: &[usize]) -> Vec<Complex64> {
    const LIGHT_M_S: f64 = 299_792_458.0;
    let Bench {
        history,
        grid,
        weights,
    } = bench;
    let collection = history.collection();
    let mut samples = vec![Complex32::ZERO; collection.pulses.len() * collection.num_samples];
    history
        .read(0..collection.pulses.len(), &mut samples)
        .unwrap();
    let total = weights.slow.iter().sum::<f64>() * weights.fast.iter().sum::<f64>();
    let value = |&pixel: &usize| {
        let columns = grid.columns.count;
        let point = grid.position_m(pixel / columns, pixel % columns);
        let rows = samples.chunks_exact(collection.num_samples);
        let pulses = collection.pulses.iter().zip(&weights.slow).zip(rows);
        let of_pulse = |((pulse, slow), row): ((&Pulse, &f64), &[Complex32])| {
            let path_m =
                (point - pulse.transmitter_m).length() + (point - pulse.receiver_m).length();
            let delay_s = (path_m - pulse.reference_path_m) / LIGHT_M_S;
            let terms = row.iter().zip(&weights.fast).enumerate();
            let terms = terms.map(|(k, (z, fast))| {
                let cycles = (pulse.start_hz + k as f64 * pulse.step_hz) * delay_s;
                Complex64::new(z.re.into(), z.im.into())
                    * Complex64::cis(TAU * (cycles - cycles.round()))
                    * (slow * fast)
            });
            terms.sum::<Complex64>()
        };
        pulses.map(of_pulse).sum::<Complex64>() / total
    };
    pixels.iter().map(value).collect()
}

/// Maps of patches are made by the processor and interpolated by the device, along rows of pixels and along columns.
#[test]
fn range_doppler_maps_keep_each_bound() {
    let Some(gpu) = gpu() else { return };
    let history = bent_track(2e3, 400, 40.0);
    for grid in ["x=-40:40:0.25,y=-39:39:0.26", "x=-80:80:0.25,y=-15:15:0.24"] {
        let bench = Bench::new(history.clone(), grid);
        let pixels: Vec<usize> = (0..150)
            .map(|i| i * 7919 % (bench.grid.num_pixels() as usize))
            .collect();
        let exact = defining_sum(&bench, &pixels);
        for bound_db in [-40.0, -70.0] {
            let counting = Counting::new(gpu);
            let former = RangeDopplerBackprojection::default().error_db(bound_db);
            let formed = bench.form(&former, Some(&counting));
            assert_eq!(formed.settings["device"], gpu.name());
            let patches = counting.patches.into_inner();
            let image = &formed.image.pixels;
            let power =
                image.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / image.len() as f64;
            let squares = pixels.iter().zip(&exact).map(|(&pixel, exact)| {
                let z = image[pixel];
                (Complex64::new(z.re.into(), z.im.into()) - exact).norm_sqr()
            });
            let error_db = 10.0 * (squares.sum::<f64>() / pixels.len() as f64 / power).log10();
            println!("{grid}, asked {bound_db} dB: {patches} patches, {error_db:.1} dB");
            assert!(
                patches > 0 && error_db <= bound_db,
                "{bound_db}: {error_db}"
            );
            let on_processor = bench.form(&former, None);
            let difference_db = relative_db(&formed.image, &on_processor.image);
            println!("difference from the processor: {difference_db:.1} dB");
            assert!(difference_db < -95.0, "{difference_db}");
        }
    }
}

/// Device that has no memory left.
#[derive(Debug)]
struct Full;

impl Device for Full {
    fn name(&self) -> &str {
        "full"
    }

    fn pixel_ns(&self) -> f64 {
        1.0
    }

    fn start<'a>(&'a self, _: &[[usize; 2]]) -> Result<Box<dyn TileSums + 'a>, DeviceError> {
        Err(DeviceError::new("full", "no memory"))
    }

    fn start_patch<'a>(
        &'a self,
        _: usize,
        _: usize,
    ) -> Result<Box<dyn PatchSums + 'a>, DeviceError> {
        Err(DeviceError::new("full", "no memory"))
    }
}

#[test]
fn errors_of_the_device_are_reported() {
    let bench = Bench::new(bent_track(2e3, 300, 40.0), "x=-40:40:0.3,y=-40:40:0.3");
    let range_doppler = RangeDopplerBackprojection::default().error_db(-50.0);
    let backprojection = Backprojection { error_db: -50.0 };
    let formers: [&dyn ImageFormer; 2] = [&range_doppler, &backprojection];
    for former in formers {
        let error = former.form_best(&bench.task(Some(&Full))).unwrap_err();
        assert_eq!(error.to_string(), "full: no memory");
    }
}

/// Value of the spline with coefficients `values` of period `length` at `t`, by the basis function's formula.
fn spline(values: &[Complex32], degree: usize, t: f64) -> Complex64 {
    let basis = |x: f64| {
        let x = x.abs();
        match degree {
            2 if x < 0.5 => 0.75 - x * x,
            2 if x < 1.5 => 0.5 * (1.5 - x).powi(2),
            3 if x < 1.0 => 2.0 / 3.0 - x * x + x * x * x / 2.0,
            3 if x < 2.0 => (2.0 - x).powi(3) / 6.0,
            _ => 0.0,
        }
    };
    let near = t.floor() as i64;
    let terms = (near - 2..=near + 3).map(|n| {
        let value = values[n.rem_euclid(values.len() as i64) as usize];
        Complex64::new(value.re.into(), value.im.into()) * basis(t - n as f64)
    });
    terms.sum()
}

#[test]
fn sums_of_tiles_equal_float64_sums() {
    let Some(gpu) = gpu() else { return };
    let (length, margin, pulses) = (200, 300, 5);
    let mut seed = 1u32;
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed >> 8) / 8_388_608.0 - 1.0
    };
    // Smooth within a bin, as upsampled profiles are.
    let profile = |random: &mut dyn FnMut() -> f64| -> Vec<Complex32> {
        let tones: Vec<[f64; 3]> = (0..20)
            .map(|_| [(30.0 * random()).round(), random(), random()])
            .collect();
        let value = |l: usize| {
            let tone = |[k, re, im]: &[f64; 3]| {
                Complex64::new(*re, *im) * Complex64::cis(TAU * k * l as f64 / length as f64)
            };
            let z: Complex64 = tones.iter().map(tone).sum();
            Complex32::new(z.re as f32, z.im as f32)
        };
        (0..length).map(value).collect()
    };
    for degree in [2, 3] {
        let profiles: Vec<Vec<Complex32>> = (0..pulses).map(|_| profile(&mut random)).collect();
        let rows = profiles.iter().flat_map(|profile| {
            let from = length - margin % length;
            profile
                .iter()
                .copied()
                .cycle()
                .skip(from)
                .take(length + 2 * margin)
        });
        let rows: Vec<Complex32> = rows.collect();
        let sizes = [[1, 1], [16, 16], [17, 40], [64, 33]];
        let mut path = || Expansion {
            legs_m: [1e3; 2],
            at: 1e5 * random(),
            first: [random(), 2.0 * random()],
            second: [2e-4 * random(), 2e-4 * random(), 2e-4 * random()],
            third: [
                2e-7 * random(),
                2e-7 * random(),
                2e-7 * random(),
                2e-7 * random(),
            ],
        };
        // The third tile is left out.
        let taken = [0, 1, 3];
        let paths: Vec<Expansion> = (0..taken.len() * pulses).map(|_| path()).collect();
        let carriers: Vec<f64> = (0..pulses).map(|n| 9.3 + n as f64).collect();
        let block = ProfileBlock {
            degree,
            length,
            margin,
            profiles: &rows,
            carriers: &carriers,
        };
        let mut sums = gpu.start(&sizes).unwrap();
        sums.load(&block).unwrap();
        sums.add(&taken, &paths).unwrap();
        sums.add(&taken[..1], &paths[..pulses]).unwrap();
        let got = sums.take().unwrap();
        let count = |[rows, columns]: &[usize; 2]| rows * columns;
        assert_eq!(got.len(), sizes.iter().map(count).sum::<usize>());
        let mut first = 0;
        for (tile, size) in sizes.iter().enumerate() {
            let own = &got[first..first + count(size)];
            let [rows, columns] = *size;
            first += count(size);
            let Some(place) = taken.iter().position(|&taken| taken == tile) else {
                assert!(own.iter().all(|z| *z == Complex32::ZERO));
                continue;
            };
            let paths = &paths[place * pulses..][..pulses];
            let half = [columns, rows].map(|count| 0.5 * (count as f64 - 1.0));
            let of_pulse = |(path, kappa): (&Expansion, &f64)| {
                let bend = path.bend_bound(half);
                // The highest tone has 30 cycles in a period.
                let oversampling = length as f64 / 60.0;
                rounding(
                    1.0 + path.linear_bound(half) + bend,
                    oversampling,
                    kappa * bend,
                )
            };
            let allowed = paths
                .iter()
                .zip(&carriers)
                .map(of_pulse)
                .fold(0.0, f64::max);
            let (mut error, mut power) = (0.0, 0.0);
            for (p, z) in own.iter().enumerate() {
                let i = (p % columns) as f64 - 0.5 * (columns as f64 - 1.0);
                let j = (p / columns) as f64 - 0.5 * (rows as f64 - 1.0);
                let term = |n: usize| {
                    let Expansion {
                        at,
                        first,
                        second,
                        third,
                        ..
                    } = paths[n];
                    let t = at
                        + first[0] * i
                        + first[1] * j
                        + second[0] * i * i
                        + second[1] * i * j
                        + second[2] * j * j
                        + third[0] * i * i * i
                        + third[1] * i * i * j
                        + third[2] * i * j * j
                        + third[3] * j * j * j;
                    Complex64::cis(TAU * (carriers[n] * t).fract())
                        * spline(&profiles[n], degree, t)
                };
                let terms: Vec<Complex64> = (0..pulses).map(term).collect();
                let times = if tile == 0 { 2.0 } else { 1.0 };
                let expected = terms.iter().sum::<Complex64>() * times;
                let got = Complex64::new(z.re.into(), z.im.into());
                error += (got - expected).norm_sqr();
                // Errors of pulses are independent.
                power += times * times * terms.iter().map(Complex64::norm_sqr).sum::<f64>();
            }
            let error_db = 10.0 * (error / power).log10();
            println!("degree {degree}, {} x {}: {error_db:.1} dB", rows, columns);
            assert!(
                error_db < 20.0 * allowed.log10(),
                "{degree} {tile}: {error_db}"
            );
        }
    }
}

#[test]
fn profiles_are_refused_that_exceed_a_buffer() {
    let Some(gpu) = gpu() else { return };
    let mut sums = gpu.start(&[[1, 1]]).unwrap();
    // Twice the largest buffer of Mesa's driver on the processor.
    let length = 1 << 25;
    let block = ProfileBlock {
        degree: 3,
        length,
        margin: 0,
        profiles: &vec![Complex32::ZERO; length],
        carriers: &[1.0],
    };
    match sums.load(&block) {
        Ok(()) => sums.wait().unwrap(),
        Err(error) => assert!(error.to_string().contains("largest buffer"), "{error}"),
    }
}

struct Cancelled;

impl Monitor for Cancelled {
    fn progress(&self, _: f64) {}

    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn forming_is_cancelled() {
    let Some(gpu) = gpu() else { return };
    let bench = Bench::new(bent_track(10e3, 100, 15.0), "x=-16:16:0.2,y=-14:14:0.2");
    let task = Task {
        monitor: &Cancelled,
        ..bench.task(Some(gpu))
    };
    let error = Backprojection { error_db: -60.0 }
        .form_best(&task)
        .unwrap_err();
    assert!(matches!(error, FormError::Cancelled), "{error}");
}
