//! Custom phase history: positions and samples in arrays, here of a point at x 2 m, y -1 m.

use std::f64::consts::TAU;

use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::geometry::SceneFrame;
use subaperture::phase_history::{Collection, InMemory, Pulse, Sweep};
use subaperture::prelude::*;

const PULSES: usize = 128;
const SAMPLES: usize = 96;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Data that a recording would provide: antenna positions, frequencies, samples.
    let antennas_m: Vec<DVec3> = (0..PULSES)
        .map(|n| DVec3::new(n as f64 - 63.5, -800.0, 600.0))
        .collect();
    let (start_hz, step_hz) = (9.5e9, 2e6);
    let samples = echoes(&antennas_m, DVec3::new(2.0, -1.0, 0.0), start_hz, step_hz);

    let pulses = antennas_m.iter().enumerate().map(|(n, &antenna_m)| Pulse {
        time_s: n as f64 * 1e-2,
        transmitter_m: antenna_m,
        receiver_m: antenna_m,
        // Phases are referred to the scene's origin.
        reference_m: DVec3::ZERO,
        reference_path_m: 2.0 * antenna_m.length(),
        start_hz,
        step_hz,
        sweep: Sweep::AT_ONCE,
        recorded_path_m: None,
    });
    let collection = Collection {
        name: "custom point".to_owned(),
        num_samples: SAMPLES,
        pulses: pulses.collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let recording = InMemory::new(collection, samples)?;

    let grid: ImageGrid = "x=-8:8:0.25,y=-8:8:0.25,z=0".parse()?;
    let image = Backprojection::default().focus(&recording, &grid)?;
    let brightest = image.brightest().ok_or("an image of zeros")?;
    let [x_m, y_m, _] = brightest.position_m;
    println!("brightest: x {x_m:.2} m, y {y_m:.2} m");
    println!("level: {:.3} dB", brightest.level_db);
    Ok(())
}

/// Samples of a unit scatterer, pulse by pulse: phases of `-2 pi f (path - reference path) / c`.
fn echoes(antennas_m: &[DVec3], point_m: DVec3, start_hz: f64, step_hz: f64) -> Vec<Complex32> {
    let mut samples = Vec::with_capacity(PULSES * SAMPLES);
    for antenna_m in antennas_m {
        let path_m = 2.0 * (antenna_m.distance(point_m) - antenna_m.length());
        for k in 0..SAMPLES {
            let frequency_hz = start_hz + k as f64 * step_hz;
            let phase_rad = -TAU * (frequency_hz * path_m / SPEED_OF_LIGHT_M_S).fract();
            samples.push(Complex32::from_polar(1.0, phase_rad as f32));
        }
    }
    samples
}
