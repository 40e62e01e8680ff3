//! Simulated recordings are bit-identical on every machine: random numbers, transforms and sines are the library's own.
//! The digests below are updated from the test's output when the simulator's arithmetic changes on purpose.

use subaperture::phase_history::PhaseHistory;
use subaperture::simulate::scenario::{Scenario, examples};
use subaperture_tests::digest;
use subaperture_tests::experiment::read_whole;

/// Example scenarios and the digests of their first channels: 24 pulses with all impairments.
const RECORDINGS: [(&str, u64); 12] = [
    ("arc", 0x9961_dc4e_215d_4f09),
    ("circular", 0x3c77_d259_51e4_2068),
    ("distributed", 0x69cb_1cb7_d443_0466),
    ("fusion", 0x496b_9b16_d499_bdad),
    ("gmti", 0x8658_5f14_e545_096f),
    ("mover", 0xa459_f76a_0bb4_a21b),
    ("rail", 0xf5ca_e388_69dd_54f9),
    ("spotlight", 0xde0f_34e2_4f20_1273),
    ("stepped", 0x9f87_4485_545e_17ef),
    ("stripmap", 0x5cfc_f25c_1837_3ac8),
    ("truck", 0x0007_b1cf_c92f_080a),
    ("walk", 0xecc0_1c09_ecf5_9daf),
];

#[test]
fn simulated_recordings_are_bit_identical_on_every_machine() {
    let mut names = RECORDINGS.map(|(name, _)| name).to_vec();
    names.sort_unstable();
    let mut all = examples::names().to_vec();
    all.sort_unstable();
    assert_eq!(names, all, "an example is missing from the list");
    let mut other = String::new();
    for (name, expected) in RECORDINGS {
        let text = examples::text(name).unwrap();
        let mut scenario = Scenario::new("example.toml", text, "/nowhere");
        scenario.set("radar.pulses", "24").unwrap();
        if matches!(name, "distributed" | "gmti") {
            // Some thousand points instead of sixty thousand.
            scenario.set("scene.clutter[0].density", "1").unwrap();
        }
        let experiment = scenario.experiment().unwrap();
        let recording = experiment.record(experiment.pairs()[0]).unwrap();
        let collection = recording.collection();
        let samples = read_whole(&recording);
        let antennas = collection
            .pulses
            .iter()
            .flat_map(|pulse| pulse.transmitter_m.to_array())
            .flat_map(f64::to_le_bytes);
        let bytes = samples
            .iter()
            .flat_map(|z| [z.re.to_le_bytes(), z.im.to_le_bytes()])
            .flatten();
        let found = digest(antennas.chain(bytes));
        if found != expected {
            other += &format!("\n    (\"{name}\", {found:#x}),");
        }
    }
    assert!(other.is_empty(), "other digests:{other}");
}
