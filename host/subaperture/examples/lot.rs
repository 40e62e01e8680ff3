//! README's program: form the image of `lot.cphd` and save it in the folder `lot`.

use subaperture::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let recording = open("lot.cphd")?;
    let grid = scene_grid(&recording)?;
    let image = Auto::default().error_db(-60.0).focus(&recording, &grid)?;
    image.save("lot")?;
    Ok(())
}
