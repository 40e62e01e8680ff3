//! Budgets of the module: memory by region, stack, flash, instructions by stage, bytes on the link. Figures and method:
//! `firmware/REPORT.md`.

use subaperture_tests::module_report::{CONFIGURATIONS, Figures, measure_all};

#[test]
fn every_figure_is_within_its_budget() {
    let all = measure_all().unwrap();
    let mut failures = Vec::new();
    for (index, figures) in all.iter().enumerate() {
        for (name, budgets) in BUDGETS {
            let (measured, budget) = (figures.get(name), budgets[index]);
            if measured > budget {
                failures.push(format!(
                    "{}: {name} is {measured}, budget {budget}",
                    figures.name
                ));
            }
        }
        check_ratio(figures, &mut failures);
    }
    assert_eq!(all.len(), CONFIGURATIONS.len());
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

/// A map without Keystone needs at most 1.75 times the instructions of its range transforms; with 128 points in fixed point, the
/// transforms are 58 % of it.
fn check_ratio(figures: &Figures, failures: &mut Vec<String>) {
    let ratio = figures.ratio();
    if ratio.is_nan() || ratio > 1.75 {
        failures.push(format!(
            "{}: a map without Keystone over its transforms is {ratio:.3}, budget 1.75",
            figures.name
        ));
    }
}

/// Budgets by configuration in the order of `CONFIGURATIONS`: small fixed, medium float, medium fixed, large float. Each is the measured
/// value with a margin: 128 bytes of DTCM, 5 % of stack, 4 % of flash, 2 % of instructions, 32 bytes per map on the link.
const BUDGETS: &[(&str, [u64; 4])] = &[
    // Bytes of RAM and flash.
    ("axi", [18_720, 487_968, 377_376, 516_864]),
    ("sram123", [4_832, 156_960, 80_288, 292_384]),
    ("dtcm", [27_588, 85_076, 85_332, 109_004]),
    ("stack", [18_000, 18_550, 18_550, 18_550]),
    ("flash_h743", [230_000, 213_500, 236_500, 213_500]),
    ("flash_an500", [225_000, 207_500, 231_500, 207_500]),
    // Instructions of a map.
    ("begin", [8_150, 13_200, 15_900, 25_300]),
    ("compensation", [92_400, 820_000, 997_000, 1_680_000]),
    ("keystone", [210_800, 3_830_000, 5_385_000, 12_400_000]),
    ("rows", [326_400, 4_923_000, 8_281_000, 15_940_000]),
    ("ffts", [248_100, 4_240_000, 6_977_000, 14_530_000]),
    ("map", [639_000, 9_601_000, 14_690_000, 30_000_000]),
    // Instructions of the other stages, and the longest step of each kind.
    ("nodes", [850, 1_440, 1_440, 2_560]),
    ("receive_pulses", [207_800, 4_033_000, 2_159_000, 9_217_000]),
    ("products", [6_425_000, 9_365_000, 15_890_000, 15_760_000]),
    ("send_map", [166_100, 4_758_000, 2_544_000, 8_626_000]),
    ("column_worst", [5_380, 11_900, 15_950, 29_500]),
    ("row_worst", [20_500, 112_000, 185_300, 234_600]),
    ("products_worst", [191_000, 52_340, 191_800, 52_370]),
    ("receive_worst", [12_900, 127_000, 67_920, 150_200]),
    ("send_worst", [9_235, 105_600, 56_320, 125_000]),
    // Over random setups.
    ("random_work_worst", [191_000, 108_200, 191_000, 230_600]),
    ("random_receive_worst", [12_100, 122_900, 65_760, 126_200]),
    ("random_send_worst", [8_198, 103_600, 54_770, 122_500]),
    // Of all steps; with the longest sent frame, so that a received byte waits at most 0.9 ms at 400 MHz.
    ("step_worst", [191_000, 232_000, 232_000, 236_000]),
    ("wait_worst", [201_200, 341_000, 292_000, 362_000]),
    // Bytes on the link.
    ("up_bytes", [5_476, 113_538, 58_116, 259_704]),
    ("down_bytes_a_map", [4_836, 156_541, 79_345, 284_056]),
    ("down_bytes", [19_344, 2_504_656, 1_269_520, 18_179_584]),
    ("chip_bytes", [4_404, 8_347, 4_400, 8_350]),
    // Increments: instructions for a pulse and for its settings, and bytes.
    (
        "odometer_configure",
        [562_000, 1_043_000, 1_043_000, 1_043_000],
    ),
    ("odometer_receive", [27_700, 331_000, 203_000, 331_000]),
    ("odometer_work", [282_000, 2_006_000, 2_006_000, 2_006_000]),
    ("odometer_worst", [50_700, 232_000, 232_000, 232_000]),
    ("odometer_up_bytes", [570, 8_320, 4_210, 8_320]),
    ("increment_bytes", [50, 50, 50, 50]),
    // Range profiles: instructions of a step of 512 samples, of the rest of a sweep, and bytes.
    ("profiler_step", [177_200, 177_300, 177_300, 177_300]),
    ("profiler_receive_worst", [25_500, 25_500, 25_500, 25_500]),
    ("profiler_work", [15_800, 74_000, 74_000, 74_000]),
    ("profiler_send", [34_800, 127_500, 127_500, 127_500]),
    (
        "profiler_up_bytes",
        [272_096, 1_089_152, 1_089_152, 1_089_152],
    ),
    ("profile_bytes", [1_128, 4_209, 4_209, 4_209]),
];
