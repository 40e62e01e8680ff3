//! Live image of a flying radar: pulses are pushed one at a time with their antenna positions, and the
//! current image is available after each. `live FOLDER` writes `live.npy` and `live.png` there.

use std::path::PathBuf;

use subaperture::focus::live::{Live, Settings};
use subaperture::io::npy;
use subaperture::plot::{Panel, quicklook};
use subaperture::prelude::*;
use subaperture::simulate::{Preset, Variation};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("give a folder")?);
    let radar = Preset::Table41.simulate(&Variation::default());
    let (pulses, num_samples) = (&radar.collection().pulses, radar.collection().num_samples);

    let grid: ImageGrid = "x=-40:40:0.8,y=-40:40:0.8,z=0".parse()?;
    let mut live = Live::new(&grid, num_samples, &Settings::default().error_db(-60.0))?;
    println!("memory: {} bytes", live.held_bytes());
    let mut samples = vec![Complex32::ZERO; num_samples];
    for (n, pulse) in pulses.iter().enumerate() {
        // A receiver would wait for the next pulse here.
        radar.read(n..n + 1, &mut samples)?;
        live.push(pulse, &samples)?;
        if live.num_pulses() % 260 == 0 {
            let (count, error_db) = (live.num_pulses(), live.accuracy().predicted_db());
            println!("after {count} pulses: error below {error_db:.1} dB");
        }
    }

    let image = live.image();
    npy::write(&folder.join("live.npy"), &image)?;
    let title = format!("{} pulses", live.num_pulses());
    std::fs::write(
        folder.join("live.png"),
        quicklook(&Panel::new(&image, &grid, title))?,
    )?;
    Ok(())
}
