//! `subap plan focus`: its cost in words and in JSON; grids outside the recorded delays.

use serde_json::Value;
use subaperture_tests::subap::run;

#[test]
fn a_plan_states_the_cost_of_comparing_with_the_exact_sum() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o a.cphd").succeeded();
    let line = "plan focus a.cphd --grid x=-20:20:0.2,y=-20:20:0.2 -o plan.json";
    let plan: Value = serde_json::from_str(run(at, &format!("{line} --json")).succeeded()).unwrap();
    // 64 pixels spread evenly and 64 drawn, 8 operations each for 1040 pulses of 256 samples; a transform of every pulse.
    let by_hand = 128.0 * 8.0 * 1040.0 * 256.0 + 1040.0 * 5.0 * 256.0 * 8.0;
    assert_eq!(plan["comparison_operations"].as_f64(), Some(by_hand));
    let [all_s, comparison_s] =
        ["core_s", "comparison_core_s"].map(|name| plan[name].as_f64().unwrap());
    assert!(comparison_s > 0.0 && all_s > comparison_s, "{plan}");
    let said = run(at, &format!("{line} --force"));
    let said = said.succeeded();
    assert!(said.contains("to compare with the exact sum"), "{said}");
    assert!(said.contains("of it to compare"), "{said}");
}

#[test]
fn pixels_outside_the_recorded_delays_are_zero_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Profiles of 191 m about the scene's middle, on a track in the direction of x at y = -5 km. They are recorded up
    // to y = 95.5 m.
    run(at, "simulate --preset table-4-1 -o a.cphd").succeeded();
    let focus = |out: &str, rows: &str| {
        let line = format!("focus a.cphd --grid x=-2:2:1,y={rows}:1 -o {out} --allow-error");
        run(at, &line)
    };
    let refused = "no pixel lies within the recorded delays";
    focus("outside", "200:204").failed(1, &[refused, "5200 m to 5203 m"]);
    let named = "pixels lie outside the recorded delays";
    for (out, rows, share) in [
        ("within", "80:84", None),
        ("partly", "94:98", Some("8 of 16 pixels")),
    ] {
        let ran = focus(out, rows);
        assert_eq!(
            ran.stderr.contains(named),
            share.is_some(),
            "{out}: {ran:?}"
        );
        let record = std::fs::read_to_string(at.join(out).join("image.json")).unwrap();
        assert_eq!(record.contains(named), share.is_some(), "{record}");
        assert!(record.contains(share.unwrap_or_default()), "{record}");
    }
}
