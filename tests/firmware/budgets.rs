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

/// A map without Keystone needs at most 1.6 times the instructions of its range transforms; with 128 points in fixed point, the
/// transforms are 64 % of it.
fn check_ratio(figures: &Figures, failures: &mut Vec<String>) {
    let ratio = figures.ratio();
    if ratio.is_nan() || ratio > 1.6 {
        failures.push(format!(
            "{}: a map without Keystone over its transforms is {ratio:.3}, budget 1.6",
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
    ("dtcm", [25_468, 82_964, 83_220, 106_892]),
    ("stack", [16_420, 17_450, 17_450, 17_450]),
    ("flash_h743", [199_700, 182_000, 205_900, 182_000]),
    ("flash_an500", [191_400, 174_700, 197_600, 174_700]),
    // Instructions of a map.
    ("begin", [8_150, 13_200, 15_900, 25_300]),
    ("compensation", [107_000, 809_000, 1_210_000, 1_680_000]),
    ("keystone", [222_500, 3_830_000, 5_850_000, 12_400_000]),
    ("rows", [421_000, 4_920_000, 11_000_000, 16_000_000]),
    ("ffts", [344_500, 4_240_000, 9_640_000, 14_600_000]),
    ("map", [758_500, 9_580_000, 18_100_000, 30_000_000]),
    // Instructions of the other stages, and the longest step of each kind.
    ("nodes", [850, 1_440, 1_440, 2_560]),
    ("receive_pulses", [203_000, 3_932_000, 2_106_000, 8_986_000]),
    ("products", [6_425_000, 9_690_000, 16_500_000, 16_830_000]),
    ("send_map", [186_000, 4_840_000, 2_620_000, 8_830_000]),
    ("column_worst", [5_610, 11_900, 17_300, 29_500]),
    ("row_worst", [25_950, 112_000, 246_500, 234_000]),
    ("products_worst", [191_000, 54_000, 191_800, 55_100]),
    ("receive_worst", [12_900, 123_500, 66_300, 147_000]),
    ("send_worst", [10_200, 108_000, 57_900, 128_000]),
    // Over random setups.
    ("random_work_worst", [191_000, 107_600, 239_800, 230_600]),
    ("random_receive_worst", [11_100, 119_900, 64_200, 123_500]),
    ("random_send_worst", [9_200, 103_600, 55_800, 122_500]),
    // Of all steps; with the longest sent frame, so that a received byte waits at most 1.1 ms at 400 MHz.
    ("step_worst", [191_000, 302_000, 302_000, 302_000]),
    ("wait_worst", [201_200, 410_000, 360_500, 430_000]),
    // Bytes on the link.
    ("up_bytes", [5_476, 113_538, 58_116, 259_704]),
    ("down_bytes_a_map", [4_834, 156_507, 79_312, 284_024]),
    ("down_bytes", [19_336, 2_504_112, 1_268_992, 18_177_536]),
    ("chip_bytes", [4_404, 8_347, 4_400, 8_350]),
    // Increments: instructions for a pulse and for its settings, and bytes.
    (
        "odometer_configure",
        [562_000, 1_043_000, 1_043_000, 1_043_000],
    ),
    ("odometer_receive", [43_000, 327_500, 327_500, 327_500]),
    ("odometer_work", [353_000, 2_311_000, 2_311_000, 2_311_000]),
    ("odometer_worst", [78_800, 298_900, 298_900, 298_900]),
    ("odometer_up_bytes", [1_080, 8_320, 8_320, 8_320]),
    ("increment_bytes", [50, 50, 50, 50]),
    // Range profiles: instructions of a step of 512 samples, of the rest of a sweep, and bytes.
    ("profiler_step", [173_500, 173_500, 173_500, 173_500]),
    ("profiler_receive_worst", [25_500, 25_500, 25_500, 25_500]),
    ("profiler_work", [15_800, 74_000, 74_000, 74_000]),
    ("profiler_send", [34_800, 127_500, 127_500, 127_500]),
    (
        "profiler_up_bytes",
        [272_096, 1_089_152, 1_089_152, 1_089_152],
    ),
    ("profile_bytes", [1_128, 4_209, 4_209, 4_209]),
];
