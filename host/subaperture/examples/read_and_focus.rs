//! Read a recording and form its image: `read_and_focus lot.cphd lot` writes a folder `lot`.

use subaperture::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().collect();
    let [_, file, folder] = words.as_slice() else {
        return Err("give a recording and a folder".into());
    };
    let (recording, former) = (open(file)?, Auto::default().error_db(-60.0));
    let image = former.focus(&recording, &scene_grid(&recording)?)?;
    image.save(folder)?;
    println!("predicted error: {:.1} dB", image.predicted_error_db);
    Ok(())
}
