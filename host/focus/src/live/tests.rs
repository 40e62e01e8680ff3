use super::*;
use subaperture_model::phase_history::Sweep;

/// Held memory equals the allocated vectors, before and after many pulses.
#[test]
fn held_memory_is_constant() {
    let grid: ImageGrid = "x=-4:4:1,y=-4:4:1,z=0".parse().unwrap();
    let settings = Settings::default().last_pulses(5);
    let mut live = Live::new(&grid, 16, &settings).unwrap();
    let allocated = |live: &Live| {
        let aperture = live.aperture.as_ref().unwrap();
        let sums = [&live.shown, &aperture.next].map(|sums| (16 + 4) * sums.pixels.capacity());
        let parts = [&live.part, &aperture.falling_out];
        let parts = parts.map(|part| 8 * part.tile.pixels.capacity());
        let ring = 8 * aperture.ring.samples.capacity()
            + size_of::<Pulse>() * aperture.ring.pulses.capacity();
        let window = 8 * live.weights.fast.capacity();
        (sums.iter().chain(&parts).sum::<usize>() + ring + window) as u128
    };
    // Except for the few pixels compared with the exact sum.
    assert_eq!(allocated(&live), live.held_bytes());
    for n in 0..40 {
        let antenna_m = DVec3::new(f64::from(n), -100.0, 0.0);
        let pulse = Pulse {
            time_s: f64::from(n),
            transmitter_m: antenna_m,
            receiver_m: antenna_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * antenna_m.length(),
            start_hz: 1e9,
            step_hz: 5e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        live.push(&pulse, &[Complex32::ONE; 16]).unwrap();
        assert_eq!(allocated(&live), live.held_bytes(), "{n}");
        assert_eq!(live.num_pulses(), 5.min(n as usize + 1));
    }
}
