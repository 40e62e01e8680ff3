//! Detections compared with the movers of scenes.

/// Number of detections and false targets, and errors of `N` kinds in units of the stated standard deviations.
pub(crate) struct Counts<const N: usize> {
    names: [&'static str; N],
    total: usize,
    detected: usize,
    false_targets: usize,
    errors: [Vec<f64>; N],
}

impl<const N: usize> Counts<N> {
    /// Make counts of errors with these names.
    pub(crate) fn new(names: [&'static str; N]) -> Self {
        Self {
            names,
            total: 0,
            detected: 0,
            false_targets: 0,
            errors: [const { Vec::new() }; N],
        }
    }

    /// Compare the targets of a scene with its movers. `errors` returns the errors of a target that is near a mover.
    pub(crate) fn add<M: std::fmt::Debug, T: std::fmt::Debug>(
        &mut self,
        scene: u64,
        movers: &[M],
        found: &[T],
        errors: impl Fn(&M, &T) -> Option<[f64; N]>,
    ) {
        self.total += movers.len();
        let mut left: Vec<&T> = found.iter().collect();
        for mover in movers {
            let near = |(i, target): (usize, &&T)| Some((i, errors(mover, target)?));
            let Some((i, own)) = left.iter().enumerate().find_map(near) else {
                println!("scene {scene}: missed {mover:.2?}");
                continue;
            };
            left.remove(i);
            self.detected += 1;
            self.errors
                .iter_mut()
                .zip(own)
                .for_each(|(all, own)| all.push(own));
        }
        self.false_targets += left.len();
        for target in left {
            println!("scene {scene}: false {target:.2?}");
        }
    }

    /// Print the counts, and assert that at least this part of the errors of each kind is within 1.96 standard deviations.
    pub(crate) fn assert_covered(&self, least: f64) {
        println!(
            "detected {} of {}, {} false",
            self.detected, self.total, self.false_targets
        );
        for (name, errors) in self.names.iter().zip(&self.errors) {
            let count = errors.len() as f64;
            let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
            let inside = errors.iter().filter(|e| e.abs() < 1.96).count() as f64 / count;
            let percent = 100.0 * inside;
            println!("{name}: RMS {rms:.2} sigma, {percent:.1} % within 1.96 sigma, {errors:.2?}");
            assert!(inside > least, "{name}: {inside}");
        }
    }

    /// Assert that at least `percent` of all movers are detected, and at most `most_false` targets are false.
    pub(crate) fn assert_detected(&self, percent: usize, most_false: u64) {
        let Self {
            total, detected, ..
        } = self;
        assert!(100 * detected >= percent * total, "{detected} of {total}");
        assert!(
            self.false_targets as u64 <= most_false,
            "{}",
            self.false_targets
        );
    }
}
