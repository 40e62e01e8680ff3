//! Simulate a radar and a scene described as text, form the image, and compare a point with theory.

use subaperture::prelude::*;
use subaperture::quality::response::{Direction, Target};
use subaperture::simulate::Pair;
use subaperture::simulate::scenario::Scenario;

const SCENARIO: &str = r#"
    seed = 7

    [radar]
    kind = "ideal"
    pulses = 256
    pri = "5 ms"
    centre = "10 GHz"
    bandwidth = "300 MHz"
    samples = 192

    [platform]
    kind = "linear"
    position = "0, -3, 2 km"
    velocity = "100, 0, 0 m/s"

    [[scene.point]]
    position = "3, 4, 0 m"
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let experiment = Scenario::new("point.toml", SCENARIO, ".").experiment()?;
    let recording = experiment.record(Pair {
        transmitter: 0,
        receiver: 0,
    })?;

    let grid: ImageGrid = "x=-5:11:0.2,y=-4:12:0.2,z=0".parse()?;
    let image = Focusing::new(&recording, &grid)
        .windows(Window::None, Window::None)
        .by(&RangeDopplerBackprojection::default())?;

    let point = image.measure(Target::Brightest)?;
    let [x_m, y_m, _] = point.position_m;
    println!("point: x {x_m:.3} m, y {y_m:.3} m");
    println!("level: {:.2} dB", point.level_db);
    let survey = image.survey.as_ref().ok_or("no pulses")?;
    let theory = survey.half_power;
    let cuts = [
        ("across", Direction::X, theory.cross_range_m),
        ("along", Direction::Y, theory.range_m),
    ];
    for (name, direction, theory_m) in cuts {
        let cut = point.cuts.iter().find(|cut| cut.along == direction);
        let cut = cut.ok_or("no such cut")?;
        println!(
            "width {name}: {:.3} m, by theory {:.3} m",
            cut.width_3db.unwrap_or(f64::NAN),
            theory_m.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}
