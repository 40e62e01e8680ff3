//! Where an image's pixels are: in a file that is read part by part, or in tiles, some of which may be still to come.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use num_complex::Complex32;
use subaperture_io::product;
use subaperture_io::tiles::TileStore;
use subaperture_model::image::{Image, Parts, PartsError, Place, copy_common};

/// Bytes of tiles of a store that are kept once they are read, so that neighbours do not read them again; one is kept in any case.
const KEPT_BYTES: usize = 48 << 20;

/// Bytes that the glance over an image in rows reads.
const GLANCE_BYTES: usize = 96 << 20;
/// Most rows and columns of a glance.
const GLANCE_SIDE: usize = 512;

/// An image's pixels.
#[derive(Debug)]
pub struct Pixels {
    kind: Kind,
    kept: Mutex<VecDeque<Kept>>,
}

/// A tile of a store by its number.
type Kept = (usize, Arc<[Complex32]>);

#[derive(Debug)]
enum Kind {
    Whole(Box<dyn Parts + Send + Sync>),
    Tiles(TileStore),
}

/// Every so manieth pixel of an image, row-major: pixel `(i steps[0], j steps[1])` at row `i` and column `j`; zeros where there is none yet.
#[derive(Clone, Debug)]
pub(super) struct Glance {
    pub(super) steps: [usize; 2],
    pub(super) image: Image,
}

impl Pixels {
    /// An image that is whole.
    pub fn whole(parts: Box<dyn Parts + Send + Sync>) -> Self {
        Self::of(Kind::Whole(parts))
    }

    /// An image in tiles, whole or still growing: what is not there yet reads as zeros.
    pub fn tiles(store: TileStore) -> Self {
        Self::of(Kind::Tiles(store))
    }

    fn of(kind: Kind) -> Self {
        Self {
            kind,
            kept: Mutex::new(VecDeque::new()),
        }
    }

    /// Places that are there and were not before; `has` remembers, an element for each piece.
    pub(super) fn new_places(&self, has: &mut [bool]) -> Vec<Place> {
        match &self.kind {
            Kind::Whole(parts) if !has[0] => {
                has[0] = true;
                parts.places()
            }
            Kind::Whole(_) => Vec::new(),
            Kind::Tiles(store) => {
                let come = |index: &usize| !has[*index] && store.has(*index);
                let new: Vec<usize> = (0..has.len()).filter(come).collect();
                new.iter().for_each(|&index| has[index] = true);
                new.iter().map(|&i| store.tiling().place(i)).collect()
            }
        }
    }

    /// In how many pieces it comes: 1 if it is whole.
    pub(super) fn num_pieces(&self) -> usize {
        match &self.kind {
            Kind::Whole(_) => 1,
            Kind::Tiles(store) => store.tiling().count(),
        }
    }

    /// A look at some hundred rows and columns.
    pub(super) fn glance(&self) -> Result<Glance, PartsError> {
        let (rows, columns) = self.size();
        let most_rows = (GLANCE_BYTES / (8 * columns.max(1))).clamp(64, GLANCE_SIDE);
        let steps = [
            rows.div_ceil(most_rows).max(1),
            columns.div_ceil(GLANCE_SIDE).max(1),
        ];
        let size = [rows.div_ceil(steps[0]), columns.div_ceil(steps[1])];
        let mut image = Image {
            rows: size[0],
            columns: size[1],
            pixels: vec![Complex32::ZERO; size[0] * size[1]],
        };
        match &self.kind {
            Kind::Whole(parts) => {
                let lines = image.pixels.chunks_exact_mut(size[1].max(1));
                for (i, line) in lines.enumerate() {
                    let row = i * steps[0];
                    let whole = parts.window(&[row..row + 1, 0..columns])?;
                    let chosen = whole.pixels.iter().step_by(steps[1]);
                    line.iter_mut()
                        .zip(chosen)
                        .for_each(|(to, from)| *to = *from);
                }
            }
            Kind::Tiles(store) => {
                for index in (0..store.tiling().count()).filter(|&index| store.has(index)) {
                    let place = store.tiling().place(index);
                    let first = [0, 1].map(|i| place[i].start.div_ceil(steps[i]));
                    let within = [0, 1].map(|i| first[i] * steps[i] - place[i].start);
                    if (0..2).any(|i| within[i] >= place[i].len()) {
                        continue;
                    }
                    let seen = store.glance(index, within, steps)?;
                    for (i, line) in seen.pixels.chunks_exact(seen.columns).enumerate() {
                        let at = (first[0] + i) * size[1] + first[1];
                        image.pixels[at..at + line.len()].copy_from_slice(line);
                    }
                }
            }
        }
        Ok(Glance { steps, image })
    }

    /// A tile of a store, kept or read; `None` where it is not there yet.
    fn tile(
        &self,
        store: &TileStore,
        index: usize,
    ) -> Result<Option<Arc<[Complex32]>>, PartsError> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, tile)) = lock().iter().find(|(kept, _)| *kept == index) {
            return Ok(Some(Arc::clone(tile)));
        }
        if !store.has(index) {
            return Ok(None);
        }
        let tile: Arc<[Complex32]> = store.read(index)?.into();
        let mut kept = lock();
        kept.push_back((index, Arc::clone(&tile)));
        let bytes = |kept: &VecDeque<Kept>| kept.iter().map(|(_, t)| 8 * t.len()).sum::<usize>();
        while kept.len() > 1 && bytes(&kept) > KEPT_BYTES {
            kept.pop_front();
        }
        Ok(Some(tile))
    }
}

impl From<product::Pixels> for Pixels {
    fn from(pixels: product::Pixels) -> Self {
        match pixels {
            product::Pixels::Array(file) => Self::whole(Box::new(file)),
            product::Pixels::Tiles(store) => Self::tiles(store),
        }
    }
}

impl Parts for Pixels {
    fn size(&self) -> (usize, usize) {
        match &self.kind {
            Kind::Whole(parts) => parts.size(),
            Kind::Tiles(store) => store.size(),
        }
    }

    fn places(&self) -> Vec<Place> {
        match &self.kind {
            Kind::Whole(parts) => parts.places(),
            Kind::Tiles(store) => store.places(),
        }
    }

    fn window(&self, place: &Place) -> Result<Image, PartsError> {
        let store = match &self.kind {
            Kind::Whole(parts) => return parts.window(place),
            Kind::Tiles(store) => store,
        };
        let [rows, columns] = place;
        let mut window = Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: vec![Complex32::ZERO; rows.len() * columns.len()],
        };
        for index in store.tiling().meeting(place) {
            if let Some(tile) = self.tile(store, index)? {
                copy_common(
                    place,
                    &mut window.pixels,
                    &store.tiling().place(index),
                    &tile,
                );
            }
        }
        Ok(window)
    }
}
