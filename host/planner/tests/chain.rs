//! Signal chains against the figures of Chim 2018, and against levels computed by hand.

use subaperture_describe::Description;
use subaperture_planner::chain::{Chain, ChainLevels, example};
use subaperture_planner::radar_equation::{Illumination, Sensitivity};

fn parse(text: &str) -> Result<Chain, String> {
    Chain::describe(&Description::new("chain.toml", text, ".")).map_err(|error| error.to_string())
}

fn close(value: f64, expected: f64, tolerance: f64, name: &str) {
    assert!(
        (value - expected).abs() < tolerance,
        "{name}: {value}, expected {expected}"
    );
}

#[test]
fn example_has_the_figures_of_the_thesis() {
    let chain = parse(example::TEXT).unwrap();
    // 5.3: "the equivalent noise figure of the receiver chain is 1.604dB", printed to 0.0005 dB.
    close(chain.noise_figure_db(), 1.604, 5e-4, "noise figure");
    // 5.3: 10 dBm, gain of 36 dB and attenuators of -10 dB: "approximately 36dBm = 4 Watts".
    close(chain.transmitted_dbm(), 36.0, 1e-9, "transmitted");
    close(chain.link().power_w, 4.0, 0.05, "watts");
    let levels = chain.levels(0.25, [[16.0; 2]; 3], 1);
    // Fig. A.5: P1dB of the PA +29 dBm. 36 dBm are 7 dB above it.
    close(levels.transmit[1].margin_db.unwrap(), -7.0, 1e-9, "PA");
    // Fig. A.3: P1dB of the LNA +15 dBm, gain 35.5 dB. Leakage of 36 - 60 dBm, and an echo from 16 m: 36 + 30 dBm + 20 log 0.25 =
    // -12.041 dB - 32.976 - 40 log 16 = -48.165 dB, -27.182 dBm. In phase 10^(-24/20) + 10^(-27.182/20) = 0.063096 + 0.043742 =
    // 0.106838: -19.426 dBm, and 16.074 dBm after the LNA.
    let lna = &levels.receive[1];
    close(lna.leakage_dbm, 11.5, 1e-9, "leakage");
    close(lna.nearest_dbm, 8.318, 2e-3, "echo");
    close(lna.margin_db.unwrap(), -1.074, 2e-3, "LNA");
    // Fig. A.1: option with an LNA at the antenna, 33 dB and 2.2 dB. 1.659587 + 5.309573 / 1995.262 = 1.662248: 2.2070 dB.
    let option = example::TEXT
        .replace("\"35.5 dB\"", "\"33 dB\"")
        .replace("\"1.6 dB\"", "\"2.2 dB\"");
    let option = parse(&option).unwrap();
    close(option.noise_figure_db(), 2.2070, 1e-4, "option");
}

#[test]
fn warnings_start_with_the_stage_and_state_the_attenuation() {
    let levels = parse(example::TEXT)
        .unwrap()
        .levels(0.25, [[16.0; 2]; 3], 1);
    let warnings = levels.warnings();
    let [pa, lna, receiver, converter] = &warnings[..] else {
        panic!("{warnings:?}")
    };
    assert_eq!(
        pa,
        "PA: level of 36.0 dBm exceeds the output compression point of 29.0 dBm; insert 7.0 dB of attenuation before it"
    );
    assert!(lna.starts_with("LNA: level of 16.1 dBm") && lna.contains("insert 1.1 dB"));
    assert!(receiver.starts_with("B210: ") && receiver.contains("insert 46.1 dB"));
    assert!(converter.starts_with("converter: ") && converter.contains("full scale of -30.0 dBm"));
    // 8 dB less power, and 47 dB of attenuation in the receiver: 28 dBm, 8.1 dBm and -38.9 dBm compress no stage.
    let cured = example::TEXT
        .replace("gain = \"-10 dB\"", "gain = \"-18 dB\"")
        .replace("gain = \"0 dB\"", "gain = \"-47 dB\"");
    let levels = parse(&cured).unwrap().levels(0.25, [[16.0; 2]; 3], 1);
    assert!(levels.warnings().is_empty(), "{:?}", levels.warnings());
}

/// Chain of a cable, an amplifier and a mixer, with 1 W transmitted.
const BY_HAND: &str = r#"
power = "0 dBm"
pulse_length = "1 ms"
cross_section = "10 m^2"
[antennas]
transmit_gain = "10 dBi"
receive_gain = "10 dBi"
isolation = "50 dB"
[[transmit]]
name = "driver"
gain = "30 dB"
compression = "33 dBm"
[[receive]]
name = "cable"
gain = "-1 dB"
[[receive]]
name = "amplifier"
gain = "20 dB"
noise_figure = "2 dB"
compression = "10 dBm"
[[receive]]
name = "mixer"
gain = "-7 dB"
noise_figure = "8 dB"
compression = "-2 dBm"
[converter]
full_scale = "0 dBm"
bits = 10
sample_rate = "1 MHz"
"#;

/// Levels at 3 cm, targets at 500 m, 1 km and 2 km, 100 pulses.
fn by_hand(text: &str) -> ChainLevels {
    let ranges_m = [500.0, 1000.0, 2000.0].map(|range_m| [range_m; 2]);
    parse(text).unwrap().levels(0.03, ranges_m, 100)
}

#[test]
fn levels_of_three_stages_agree_with_hand_calculation() {
    let levels = by_hand(BY_HAND);
    close(levels.transmitted_dbm, 30.0, 1e-9, "transmitted");
    close(levels.transmit[0].margin_db.unwrap(), 3.0, 1e-9, "driver");
    // Friis. Cable: its loss, F = 1.258925. Amplifier: + 0.584893 / 0.794328 = 1.995262, the sum of both figures.
    // Mixer: + 5.309573 / 79.4328 = 2.062105.
    // Echo at 1 km: 0 dBW + 20 - 30.458 - 32.976 - 120 + 10 = -153.434 dBW = -123.434 dBm; 12.041 dB more at half the range.
    // Noise at the antenna: -203.975 + 30 + 60 = -113.975 dBm, and SNR -9.459 dB less the noise figure.
    // Leakage 30 - 50 dBm.
    let rows = [
        ("antenna", 0.0, 0.0, None),
        ("cable", -1.0, 1.0, None),
        ("amplifier", 19.0, 3.0, Some(11.0)),
        ("mixer", 12.0, 3.1431, Some(6.0)),
    ];
    assert_eq!(levels.receive.len(), rows.len());
    for (row, (name, gain_db, figure_db, margin_db)) in levels.receive.iter().zip(rows) {
        assert_eq!(row.name, name);
        close(row.gain_db, gain_db, 1e-9, name);
        close(row.noise_figure_db, figure_db, 1e-4, name);
        close(row.leakage_dbm, -20.0 + gain_db, 1e-9, name);
        close(row.nearest_dbm, -111.393 + gain_db, 2e-3, name);
        close(row.farthest_dbm, -135.475 + gain_db, 2e-3, name);
        close(row.snr_db, -9.459 - figure_db, 3e-3, name);
        // The nearest echo in phase with the leakage adds 20 log (1 + 10^(-91.4 / 20)) = 0.0002 dB.
        assert_eq!(row.margin_db.is_some(), margin_db.is_some(), "{name}");
        if let Some((got, expected)) = row.margin_db.zip(margin_db) {
            close(got, expected, 1e-3, name);
        }
    }
    assert_eq!(levels.first_to_saturate, "mixer");
    assert!(levels.warnings().is_empty());

    let converter = &levels.converter;
    close(converter.margin_db, 8.0, 1e-3, "converter");
    // -113.975 + 3.143 + 12 dBm.
    close(converter.thermal_noise_dbm, -98.832, 2e-3, "thermal");
    // 10 bits: 60.206 + 1.761 dB below full scale.
    close(converter.quantisation_noise_dbm, -61.967, 1e-3, "bits");
    // At the converter the amplifier compresses at 10 - 7 = 3 dBm, the mixer at -2 dBm.
    assert_eq!(converter.limited_by, "mixer");
    close(converter.dynamic_range_db, 59.967, 1e-3, "range");
    // -111.434 dBm in -61.967 dBm and 0.0009 dB of thermal noise; 30 dB by 1000 samples, 20 dB by 100 pulses.
    close(converter.sample_snr_db, -49.468, 3e-3, "sample");
    close(converter.pulse_snr_db, -19.468, 3e-3, "pulse");
    close(converter.image_snr_db, 0.532, 3e-3, "image");

    // 20 bits: 122.173 dB, below the thermal noise.
    let fine = by_hand(&BY_HAND.replace("bits = 10", "bits = 20")).converter;
    close(fine.dynamic_range_db, 96.832, 2e-3, "thermal range");
    // Without a limit of the mixer, full scale is the limit: the amplifier's 3 dBm are above it.
    let wide = BY_HAND.replace("compression = \"-2 dBm\"\n", "");
    let wide = by_hand(&wide);
    assert_eq!(wide.converter.limited_by, "converter");
    assert_eq!(wide.first_to_saturate, "converter");
}

#[test]
fn margin_is_that_of_leakage_and_nearest_echo_in_phase() {
    // An isolation of 141.393 dB: leakage and nearest echo are both -111.393 dBm, in phase 6.021 dB more; -106.372 dBm at the mixer less 7.
    let equal = by_hand(&BY_HAND.replace("\"50 dB\"", "\"141.393 dB\""));
    close(
        equal.converter.level_dbm,
        -111.393 + 12.0 + 6.021,
        3e-3,
        "level",
    );
    close(
        equal.receive[3].margin_db.unwrap(),
        -2.0 + 93.372,
        3e-3,
        "mixer",
    );
}

#[test]
fn snr_without_quantisation_is_that_of_the_radar_equation() {
    let chain = parse(&BY_HAND.replace("bits = 10", "bits = 32")).unwrap();
    let levels = chain.levels(0.03, [[500.0; 2], [1000.0; 2], [2000.0; 2]], 100);
    let lit = Illumination {
        wavelength_m: 0.03,
        ranges_m: [1000.0; 2],
        bandwidth_hz: 100e6,
        pulse_s: chain.pulse_s,
        num_pulses: 100,
        cell_m: None,
    };
    // That is for 1 m^2, in any noise bandwidth; 10 m^2 are 10 dB more.
    let sensitivity = Sensitivity::new(&chain.link(), &lit);
    let converter = &levels.converter;
    close(
        converter.pulse_snr_db,
        sensitivity.pulse_snr_db + 10.0,
        1e-6,
        "pulse",
    );
    close(
        converter.image_snr_db,
        sensitivity.image_snr_db + 10.0,
        1e-6,
        "image",
    );
}

#[test]
fn faults_of_a_chain_name_line_and_remedy() {
    let refused = |from: &str, to: &str, place: &str, words: &str| {
        let text = BY_HAND.replacen(from, to, 1);
        assert_ne!(text, BY_HAND);
        let error = parse(&text).unwrap_err();
        assert!(error.starts_with(place) && error.contains(words), "{error}");
    };
    refused(
        "noise_figure = \"2 dB\"\n",
        "",
        "chain.toml:18:8: amplifier: ",
        "add noise_figure",
    );
    refused(
        "\"10 dBi\"",
        "\"10 dB\"",
        "chain.toml:6:17",
        "found a level",
    );
    refused("bits = 10", "bits = 0", "chain.toml:28:8", "1 to 32");
    refused("\"33 dBm\"", "\"33\"", "chain.toml:12:15", "has no unit");
    refused("gain = \"-7 dB\"\n", "", "chain.toml:21:1", "gain");
    let (before, after) = (
        BY_HAND.split("[[receive]]").next().unwrap(),
        BY_HAND.split_once("[converter]").unwrap().1,
    );
    let error = parse(&format!("{before}[converter]{after}")).unwrap_err();
    assert!(error.contains("found no [[receive]]"), "{error}");
}
