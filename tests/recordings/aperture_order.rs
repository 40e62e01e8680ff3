//! Several recordings as one aperture: the order of naming changes no bit, and a recording named twice is refused.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::bp::Backprojection;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::phase_history::{
    Channels, Collection, InMemory, InputFile, Joined, PhaseHistory, Pulse, ReadError, Sweep,
    Weights,
};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Scatterer};

/// A recording with its start time, ns.
struct Started(InMemory, Option<i64>);

impl PhaseHistory for Started {
    fn collection(&self) -> &Collection {
        self.0.collection()
    }

    fn read(
        &self,
        pulses: std::ops::Range<usize>,
        samples: &mut [Complex32],
    ) -> Result<(), ReadError> {
        self.0.read(pulses, samples)
    }

    fn start_ns(&self) -> Option<i64> {
        self.1
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.0.inputs()
    }
}

/// Antenna of pulse `n` on a circle around the origin, starting at `from` degrees with steps of an eighth of a degree.
fn around(from_deg: f64, n: usize) -> DVec3 {
    let angle = (from_deg + n as f64 / 8.0).to_radians();
    DVec3::new(7000.0 * angle.cos(), 7000.0 * angle.sin(), 7000.0)
}

/// A recording of two points with pulses at `antennas`, a millisecond apart.
fn recorded(name: &str, antennas: &[DVec3], timed: bool) -> (Collection, Vec<Complex32>) {
    let pulses = antennas.iter().enumerate().map(|(n, &antenna)| Pulse {
        time_s: n as f64 * 1e-3,
        transmitter_m: antenna,
        receiver_m: antenna,
        reference_m: DVec3::ZERO,
        reference_path_m: 2.0 * antenna.length(),
        start_hz: 9.3e9,
        step_hz: 5e6,
        sweep: Sweep::AT_ONCE,
        recorded_path_m: None,
    });
    let collection = Collection {
        name: name.to_owned(),
        num_samples: 16,
        pulses: pulses.collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed,
    };
    let point = |x, y| Scatterer {
        position_m: DVec3::new(x, y, 0.0),
        amplitude: Complex64::ONE,
    };
    let points = vec![point(1.0, 0.5), point(-2.0, 1.5)];
    let simulated = PointTargetHistory::new(collection.clone(), points, None);
    let mut samples = vec![Complex32::ZERO; antennas.len() * 16];
    simulated.read(0..antennas.len(), &mut samples).unwrap();
    (collection, samples)
}

type Part = (Collection, Vec<Complex32>, Option<i64>);

fn join(parts: &[&Part]) -> Result<Joined, ReadError> {
    let boxed = parts.iter().map(|(collection, samples, start_ns)| {
        let recorded = InMemory::new(collection.clone(), samples.clone()).unwrap();
        Box::new(Started(recorded, *start_ns)) as Box<dyn PhaseHistory>
    });
    Joined::join(boxed.collect())
}

fn image(history: &dyn PhaseHistory) -> Vec<Complex32> {
    let grid: ImageGrid = "x=-4:4:0.25,y=-4:4:0.25,z=0".parse().unwrap();
    let weights = Weights::new(history.collection(), Window::None, Window::default());
    let task = Task {
        memory_bytes: 1 << 28,
        ..Task::new(history, &grid, &weights)
    };
    let former = Backprojection { error_db: -60.0 };
    former.form(&task).unwrap().image.pixels
}

fn antennas(aperture: &Joined) -> Vec<DVec3> {
    let pulses = &aperture.collection().pulses;
    pulses.iter().map(|p| p.transmitter_m).collect()
}

/// All permutations of three.
const ORDERS: [[usize; 3]; 6] = [
    [0, 1, 2],
    [0, 2, 1],
    [1, 0, 2],
    [1, 2, 0],
    [2, 0, 1],
    [2, 1, 0],
];

fn check_orders(parts: &[Part; 3], expected: &[DVec3]) {
    let mut first: Option<Vec<Complex32>> = None;
    for order in ORDERS {
        let aperture = join(&order.map(|i| &parts[i])).unwrap();
        assert_eq!(antennas(&aperture), expected, "{order:?}");
        let got = image(&aperture);
        match &first {
            None => first = Some(got),
            Some(first) => assert!(*first == got, "{order:?}: other bits"),
        }
    }
}

#[test]
fn recordings_without_times_are_ordered_by_angle() {
    // Across 180 degrees, where the arc tangent jumps, and in both directions.
    for (direction, start_deg) in [(1.0, 175.0), (-1.0, 3.0)] {
        let at = |n: usize| {
            let angle = (start_deg + direction * n as f64 / 8.0).to_radians();
            DVec3::new(7000.0 * angle.cos(), 7000.0 * angle.sin(), 7000.0)
        };
        let all: Vec<DVec3> = (0..120).map(at).collect();
        let parts = [0..40, 40..80, 80..120].map(|range| {
            let (collection, samples) = recorded("degree", &all[range], false);
            (collection, samples, None)
        });
        check_orders(&parts, &all);
        let joined = join(&[&parts[2], &parts[0], &parts[1]]).unwrap();
        let collection = joined.collection();
        assert!(!collection.timed);
        // Times are pulse numbers.
        assert!((0..120).all(|n| collection.pulses[n].time_s == n as f64));
    }
}

#[test]
fn times_count_from_the_earliest_start() {
    let all: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    // The middle part has the earliest start time.
    let seconds = 1_000_000_000;
    let stretch = |range: std::ops::Range<usize>, start_ns| {
        let (collection, samples) = recorded("stretch", &all[range], true);
        (collection, samples, start_ns)
    };
    let parts = [
        stretch(0..40, Some(1_700_000_000 * seconds + 2 * seconds)),
        stretch(40..80, Some(1_700_000_000 * seconds)),
        stretch(80..120, Some(1_700_000_000 * seconds + seconds)),
    ];
    let expected: Vec<DVec3> = [&all[40..80], &all[80..], &all[..40]].concat();
    check_orders(&parts, &expected);
    let joined = join(&[&parts[0], &parts[1], &parts[2]]).unwrap();
    let pulses = &joined.collection().pulses;
    for (n, pulse) in pulses.iter().enumerate() {
        let expected_s = (n / 40) as f64 + (n % 40) as f64 * 1e-3;
        assert!((pulse.time_s - expected_s).abs() < 1e-12, "{n}");
    }
    // Start times that only some recordings have are not used: the order is by angle, without times.
    let unknown = [
        stretch(0..40, None),
        stretch(40..80, Some(7)),
        stretch(80..120, None),
    ];
    check_orders(&unknown, &all);
    assert!(
        !join(&[&unknown[1], &unknown[0]])
            .unwrap()
            .collection()
            .timed
    );
}

#[test]
fn alternating_pulses_are_interleaved() {
    let all: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    let (whole, samples) = recorded("whole", &all, true);
    let turn = |which: usize| {
        let mut part = whole.clone();
        part.pulses = whole
            .pulses
            .iter()
            .skip(which)
            .step_by(3)
            .copied()
            .collect();
        let rows = samples.chunks(16).skip(which).step_by(3);
        (part, rows.flatten().copied().collect(), None)
    };
    let parts = [turn(0), turn(1), turn(2)];
    check_orders(&parts, &all);
    let joined = join(&[&parts[1], &parts[2], &parts[0]]).unwrap();
    for range in [0..120, 7..8, 3..50] {
        let mut got = vec![Complex32::ZERO; range.len() * 16];
        joined.read(range.clone(), &mut got).unwrap();
        assert_eq!(got, samples[range.start * 16..range.end * 16]);
    }
    let recorded = InMemory::new(whole, samples).unwrap();
    assert!(image(&joined) == image(&recorded));
}

#[test]
fn single_recording_is_put_in_order() {
    let all: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    let (whole, samples) = recorded("whole", &all, true);
    let shuffled: Vec<usize> = (0..120).map(|n| n * 49 % 120).collect();
    let mut part = whole.clone();
    part.pulses = shuffled.iter().map(|&n| whole.pulses[n]).collect();
    let rows = shuffled
        .iter()
        .flat_map(|&n| samples[n * 16..(n + 1) * 16].to_vec());
    let joined = join(&[&(part, rows.collect(), None)]).unwrap();
    assert_eq!(joined.collection().name, "whole");
    assert_eq!(antennas(&joined), all);
    assert!(image(&joined) == image(&InMemory::new(whole, samples).unwrap()));
}

#[test]
fn passes_without_times_share_window_over_angle() {
    // Two passes, one higher: both have the same window over angle. A window by pulse index would be flat in the middle of the second pass.
    let low: Vec<DVec3> = (0..60).map(|n| around(20.0, n)).collect();
    let high: Vec<DVec3> = low.iter().map(|at| at + DVec3::Z * 100.0).collect();
    let [low, high] = [low, high].map(|antennas| {
        let (collection, samples) = recorded("pass", &antennas, false);
        (collection, samples, None)
    });
    let joined = join(&[&high, &low]).unwrap();
    let weights = Weights::new(joined.collection(), Window::None, Window::default());
    let one = Window::default().weights(120);
    let heights = joined.collection().pulses.iter().map(|p| p.transmitter_m.z);
    for height in [7000.0, 7100.0] {
        let of_pass: Vec<f64> = heights
            .clone()
            .zip(&weights.slow)
            .filter_map(|(z, &weight)| (z == height).then_some(weight))
            .collect();
        assert_eq!(of_pass.len(), 60);
        for (n, weight) in of_pass.iter().enumerate() {
            // Two pulses at one angle are neighbours in the window, in either order.
            assert!([one[2 * n], one[2 * n + 1]].contains(weight), "{n}");
        }
    }
}

/// Case `message-names-both-files-alike`: the files of one collection have the same name, so messages add the file name.
#[test]
fn messages_of_recordings_with_one_name_give_the_file_names() {
    use subaperture::io::cphd::{Channel, WriteOptions, write};
    use subaperture::io::open::{Options, open_all, open_channels};
    use subaperture::monitor::Silent;
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    let stored = |file: &str, range: std::ops::Range<usize>, channels: &[&str], width: usize| {
        let (mut collection, samples) = recorded("case", &all[range], true);
        let samples: Vec<Complex32> = (samples.chunks(collection.num_samples))
            .flat_map(|row| row[..width].to_vec())
            .collect();
        collection.num_samples = width;
        collection.frame = SceneFrame::Earth {
            origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
            x_axis_ecf: DVec3::Y,
            y_axis_ecf: DVec3::Z,
        };
        for pulse in &mut collection.pulses {
            pulse.time_s = (pulse.transmitter_m.y / 7000.0).asin();
        }
        let history = InMemory::new(collection, samples).unwrap();
        let channels: Vec<Channel> = (channels.iter())
            .map(|name| Channel::new(*name, &history))
            .collect();
        let path = folder.path().join(file);
        write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
        path
    };
    let first = stored("first.cphd", 0..60, &["1"], 16);
    let second = stored("second.cphd", 50..120, &["1"], 16);
    let narrow = stored("narrow.cphd", 60..120, &["1"], 12);
    let refused = |a: &std::path::Path, b: &std::path::Path| {
        let error = open_all(&[a, b], &Options::default()).err().unwrap();
        error.to_string()
    };
    let both = [&first, &second].map(|path| path.display().to_string());
    let error = refused(&first, &second);
    assert!(
        both.iter().all(|name| error.contains(name.as_str())),
        "{error}"
    );
    assert!(error.contains("share 10 pulses"), "{error}");
    let error = refused(&first, &narrow);
    assert!(
        error.contains("first.cphd has 16 samples") && error.contains("narrow.cphd has 12"),
        "{error}"
    );
    let other = stored("other.cphd", 60..120, &["2"], 16);
    let opened = [&first, &other]
        .map(|path| open_channels::<&str>(path, None, &Options::default()).unwrap());
    let error = Channels::join(opened.into()).err().unwrap().to_string();
    assert!(
        error.contains("first.cphd") && error.contains("other.cphd"),
        "{error}"
    );
}

/// A spiral of three turns that climbs, without times.
fn spiral(num_pulses: usize) -> Vec<DVec3> {
    let at = |n: usize| {
        let turns = 3.0 * n as f64 / num_pulses as f64;
        let (sin, cos) = (std::f64::consts::TAU * turns).sin_cos();
        DVec3::new(7000.0 * cos, 7000.0 * sin, 5000.0 + 500.0 * turns)
    };
    (0..num_pulses).map(at).collect()
}

#[test]
fn slow_time_weights_are_the_same_with_and_without_times() {
    let spiral = spiral(720);
    let gap: Vec<DVec3> = (spiral.iter().enumerate())
        .filter(|(n, _)| !(300..330).contains(n))
        .map(|(_, at)| *at)
        .collect();
    let arc: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    let there_and_back: Vec<DVec3> = arc.iter().chain(arc.iter().rev()).copied().collect();
    for antennas in [spiral, gap, arc, there_and_back] {
        let weights = [false, true].map(|timed| {
            let (collection, _) = recorded("one", &antennas, timed);
            Weights::new(&collection, Window::None, Window::default()).slow
        });
        assert_eq!(weights[0], weights[1]);
        assert_eq!(weights[0], Window::default().weights(antennas.len()));
    }
}

#[test]
fn unordered_pulses_without_times_are_weighted_by_angle() {
    let arc: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    let shuffled: Vec<DVec3> = (0..120).map(|n| arc[n * 49 % 120]).collect();
    let (collection, _) = recorded("shuffled", &shuffled, false);
    let weights = Weights::new(&collection, Window::None, Window::default()).slow;
    let window = Window::default().weights(120);
    for (n, weight) in weights.into_iter().enumerate() {
        // The window is symmetric, so both directions agree up to its rounding.
        assert!((weight - window[n * 49 % 120]).abs() < 1e-12, "{n}");
    }
}

#[test]
fn recording_named_twice_is_refused() {
    let all: Vec<DVec3> = (0..120).map(|n| around(20.0, n)).collect();
    let refused = |a: &Part, b: &Part, parts: [&str; 3]| {
        let text = join(&[a, b]).err().unwrap().to_string();
        for part in parts {
            assert!(text.contains(part), "{text}");
        }
    };
    for timed in [false, true] {
        let (collection, samples) = recorded("one", &all, timed);
        let one = (collection, samples, None);
        refused(
            &one,
            &one,
            ["one and one", "share 120 pulses", "counts once"],
        );
        // The last twenty pulses again at the start of another recording.
        let mut other = one.clone();
        other.0.name = "other".to_owned();
        other.0.pulses.drain(..100);
        other.1.drain(..100 * 16);
        refused(
            &other,
            &one,
            ["share 20 pulses", "other", "pulse 100 of one"],
        );
    }
    // A stationary radar repeats the same pulse a second later.
    let (collection, samples) = recorded("one", &all, true);
    let one = (collection, samples, Some(0));
    let mut later = one.clone();
    later.2 = Some(1_000_000_000);
    assert_eq!(
        join(&[&later, &one]).unwrap().collection().pulses.len(),
        240
    );
}
