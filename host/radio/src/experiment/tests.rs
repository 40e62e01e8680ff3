use super::*;

fn of(text: &str) -> Result<Experiment, String> {
    let description = Description::new("radio.toml", text, "/folder");
    Experiment::describe(&description).map_err(|error| error.to_string())
}

const PLAN: &str = "[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = 50\n";

#[test]
fn paths_start_at_the_folder_and_keys_belong_to_their_kind() {
    let text = format!(
        "{PLAN}[device]\nkind = \"simulated\"\nscenario = \"a.toml\"\nleakage = 0\n[files]\nrecording = \"b\"\n"
    );
    let experiment = of(&text).unwrap();
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
    let refused = of(&format!(
        "{PLAN}[device]\nkind = \"uhd\"\nscenario = \"a.toml\"\n"
    ));
    assert!(refused.unwrap_err().contains("radio.toml:7"));
    assert!(of(PLAN).unwrap_err().contains("kind"));
}

#[test]
fn every_example_is_what_it_says() {
    for name in examples::names() {
        let text = examples::text(name).unwrap();
        if name.ends_with("-scene") {
            Scenario::new(name, text, ".").experiment().unwrap();
            continue;
        }
        let experiment = of(text).unwrap();
        let ranges = crate::transceiver::Ranges::b210();
        experiment.plan.check(&ranges).unwrap();
        assert_eq!(matches!(experiment.device, Device::Uhd(_)), name == "b210");
        assert_eq!(experiment.live.is_some(), ["rail", "walk"].contains(&name));
    }
}

#[test]
fn a_live_image_has_a_grid_and_one_way_to_move() {
    let rest = "[device]\nkind = \"replay\"\nrecording = \"a\"\n[live]\n";
    let with = |lines: &str| of(&format!("{PLAN}{rest}{lines}"));
    let grid = "grid = \"x=-1:1:0.5,y=2:3:0.5\"\n";
    let file = with(&format!(
        "{grid}track = \"t.csv\"\nzero = \"3 s\"\nlast = 9\n"
    ));
    let live = file.unwrap().live.unwrap();
    assert_eq!(live.way, Way::File(PathBuf::from("/folder/t.csv"), 3.0));
    assert_eq!((live.last, live.grid.num_pixels()), (Some(9), 8));
    let rail = "position = \"1, 2, 3 m\"\nvelocity = \"0.5, 0, 0 m/s\"\nzero = \"2 s\"\n";
    let live = with(&format!("{grid}{rail}")).unwrap().live.unwrap();
    // A second after it was there.
    let pose = live.way.track().unwrap().pose(3.0);
    assert_eq!(pose.position_m.to_array(), [1.5, 2.0, 3.0]);
    // Or nobody knows how: of two receivers by the leakage.
    let by_echoes = |reference: &str, lines: &str| {
        let antennas = "[antennas]\ntransmitter = \"0, 0, 0 m\"\nreceiver_0 = \"0.2, 0, 0 m\"\nreceiver_1 = \"0.3, 0, 0 m\"\n";
        of(&format!(
            "{PLAN}reference = \"{reference}\"\n{antennas}{rest}{grid}echoes = true\n{lines}"
        ))
    };
    let live = by_echoes("leakage", "position = \"1, 2, 3 m\"\n")
        .unwrap()
        .live
        .unwrap();
    let start_m = glam::DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(live.way, Way::Echoes { start_m });
    assert!(live.way.track().unwrap_err().to_string().contains("echoes"));
    for (refused, told) in [
        (by_echoes("loopback", ""), "plan.reference is \"leakage\""),
        (by_echoes("leakage", "track = \"t.csv\"\n"), "echoes = true"),
        (by_echoes("leakage", rail), "echoes = true"),
    ] {
        let refused = refused.unwrap_err();
        assert!(refused.contains(told), "{refused}");
    }
    for (wrong, told) in [
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
            refused.contains(told) && refused.contains("radio.toml:"),
            "{refused}"
        );
    }
}

#[cfg(not(feature = "uhd"))]
#[test]
fn without_the_feature_a_usrp_is_refused_with_what_to_do() {
    let experiment = of(&format!("{PLAN}[device]\nkind = \"uhd\"\n")).unwrap();
    let refused = experiment.with_radio(1 << 20, |_| ()).unwrap_err();
    assert!(refused.to_string().contains("feature"), "{refused}");
}
