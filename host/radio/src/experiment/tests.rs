use subaperture_describe::Description;

use super::*;

fn parse(text: &str) -> Result<Experiment, String> {
    let description = Description::new("radio.toml", text, "/folder");
    Experiment::describe(&description).map_err(|error| error.to_string())
}

const PLAN: &str = "[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = 50\n";

#[test]
fn paths_are_relative_to_the_file_and_keys_of_other_kinds_are_refused() {
    let text = format!(
        "{PLAN}[device]\nkind = \"simulated\"\nscenario = \"a.toml\"\nleakage = 0\n[files]\nrecording = \"b\"\n"
    );
    let experiment = parse(&text).unwrap();
    assert_eq!(experiment.recording, Some(PathBuf::from("/folder/b")));
    assert_eq!((experiment.plan.steps, experiment.faults), (50, None));
    let Device::Simulated(simulated) = experiment.device else {
        panic!("another kind");
    };
    assert_eq!(simulated.scenario, PathBuf::from("/folder/a.toml"));
    assert_eq!(
        simulated.wiring,
        Wiring::loopback(15.0 * 1e-9, 20.0 * 1e-9, None)
    );
    let refused = parse(&format!(
        "{PLAN}[device]\nkind = \"uhd\"\nscenario = \"a.toml\"\n"
    ));
    assert!(refused.unwrap_err().contains("radio.toml:7"));
    assert!(parse(PLAN).unwrap_err().contains("kind"));
}

#[test]
fn every_example_fits_its_device() {
    for name in examples::names() {
        let text = examples::text(name).unwrap();
        if name.ends_with("-scene") {
            Scenario::new(name, text, ".").experiment().unwrap();
            continue;
        }
        let description = Description::new(name, text, ".");
        let ranges = crate::transceiver::Ranges::b210();
        let experiment = match AnyExperiment::describe(description, &[]).unwrap() {
            AnyExperiment::Radio(experiment) => experiment,
            AnyExperiment::Chirps(experiment) => {
                assert_eq!(name, "chirp");
                experiment.plan.check(&ranges).unwrap();
                continue;
            }
            AnyExperiment::Analyser(_) => {
                assert_eq!(name, "vna");
                continue;
            }
        };
        experiment.plan.check(&ranges).unwrap();
        assert_eq!(matches!(experiment.device, Device::Uhd(_)), name == "b210");
        assert_eq!(experiment.live.is_some(), ["rail", "walk"].contains(&name));
    }
}

#[test]
fn live_image_needs_a_cartesian_grid_and_exactly_one_motion() {
    let rest = "[device]\nkind = \"replay\"\nrecording = \"a\"\n[live]\n";
    let with = |lines: &str| parse(&format!("{PLAN}{rest}{lines}"));
    let grid = "grid = \"x=-1:1:0.5,y=2:3:0.5\"\n";
    let file = with(&format!(
        "{grid}track = \"t.csv\"\nzero = \"3 s\"\nlast = 9\n"
    ));
    let live = file.unwrap().live.unwrap();
    assert_eq!(
        live.motion,
        BodyMotion::File(PathBuf::from("/folder/t.csv"), 3.0)
    );
    assert_eq!((live.last, live.grid.num_pixels()), (Some(9), 8));
    let rail = "position = \"1, 2, 3 m\"\nvelocity = \"0.5, 0, 0 m/s\"\nzero = \"2 s\"\n";
    let live = with(&format!("{grid}{rail}")).unwrap().live.unwrap();
    // One second after `zero`.
    let pose = live.motion.track().unwrap().pose(3.0);
    assert_eq!(pose.position_m.to_array(), [1.5, 2.0, 3.0]);
    // Motion from echoes needs two receivers and a leakage reference.
    let by_echoes = |reference: &str, lines: &str| {
        let antennas = "[antennas]\ntransmitter = \"0, 0, 0 m\"\nreceiver_0 = \"0.2, 0, 0 m\"\nreceiver_1 = \"0.3, 0, 0 m\"\n";
        parse(&format!(
            "{PLAN}reference = \"{reference}\"\n{antennas}{rest}{grid}echoes = true\n{lines}"
        ))
    };
    let live = by_echoes("leakage", "position = \"1, 2, 3 m\"\n")
        .unwrap()
        .live
        .unwrap();
    let start_m = glam::DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(live.motion, BodyMotion::Echoes { start_m });
    assert!(
        live.motion
            .track()
            .unwrap_err()
            .to_string()
            .contains("echoes")
    );
    for (refused, expected) in [
        (by_echoes("loopback", ""), "plan.reference is \"leakage\""),
        (by_echoes("leakage", "track = \"t.csv\"\n"), "echoes = true"),
        (by_echoes("leakage", rail), "echoes = true"),
    ] {
        let refused = refused.unwrap_err();
        assert!(refused.contains(expected), "{refused}");
    }
    for (wrong, expected) in [
        (
            format!("{grid}{rail}track = \"t.csv\"\n"),
            "a track, or position and velocity",
        ),
        (grid.to_owned(), "a track, or position and velocity"),
        (
            format!("{grid}position = \"1, 2, 3 m\"\n"),
            "a track, or position and velocity",
        ),
        (format!("{rail}grid = \"x=1\"\n"), "grid"),
        (
            format!("{rail}grid = \"r=1:2:0.1,theta=0:90:1\"\n"),
            "Cartesian",
        ),
        (rail.to_owned(), "grid"),
    ] {
        let refused = with(&wrong).unwrap_err();
        assert!(
            refused.contains(expected) && refused.contains("radio.toml:"),
            "{refused}"
        );
    }
}

#[cfg(not(feature = "uhd"))]
#[test]
fn usrp_without_uhd_feature_is_refused_with_advice() {
    let experiment = parse(&format!("{PLAN}[device]\nkind = \"uhd\"\n")).unwrap();
    let refused = experiment.with_radio(1 << 20, |_| ()).unwrap_err();
    assert!(refused.to_string().contains("feature"), "{refused}");
}
