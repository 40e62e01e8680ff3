//! Images, layers and maps of a page, and the thread that computes the overviews.

use std::collections::HashSet;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::Semaphore;

use super::shown::Shown;
use super::{DopplerMaps, Layer, Product, doppler, look};
use crate::MAX_CONNECTIONS;

/// Interval at which an incomplete image is checked for new tiles.
const EVERY: Duration = Duration::from_millis(700);

/// Memory of the states of one image being sent, bytes: 4 KiB to every client.
pub const MAX_STATE_BYTES: u64 = (MAX_CONNECTIONS as u64) << 12;

/// Limits of memory and computation.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Memory of all overviews together, bytes. An overview of one tile is kept in any case.
    pub overview_bytes: u64,
    /// Maximum number of requests computed at a time, one thread each. One more thread encodes the state.
    pub computing: usize,
    /// Memory of one request while it is computed, bytes, in addition to some megabytes for a tile.
    pub request_bytes: u64,
    /// Memory of drawing a picture with the same automatic levels, bytes; taken for one image at a time. `None`: levels of a coarser
    /// overview.
    pub picture_bytes: Option<u64>,
    /// Memory of all responses being sent, bytes, in addition to [`MAX_STATE_BYTES`] per image. A larger response is sent alone.
    pub answer_bytes: u64,
}

impl Bounds {
    pub(super) fn answer_kib(&self) -> u32 {
        u32::try_from(self.answer_bytes >> 10).map_or(1 << 20, |kib| kib.clamp(1, 1 << 20))
    }
}

/// Images and layers shown by a [`crate::Server`].
pub struct Gallery {
    pub(super) shown: Vec<Shown>,
    pub(super) layers: Vec<Layer>,
    pub(super) maps: Vec<Box<dyn DopplerMaps>>,
    pub(super) computing: Arc<Semaphore>,
    /// One permit per kibibyte of [`Bounds::answer_bytes`].
    pub(super) answers: Arc<Semaphore>,
    /// One permit for the encoding of the state.
    pub(super) encoding: Semaphore,
    pub(crate) bounds: Bounds,
    begun: AtomicBool,
}

impl std::fmt::Debug for Gallery {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<&str> = self.shown.iter().map(|s| s.product.name.as_str()).collect();
        f.debug_struct("Gallery").field("images", &names).finish()
    }
}

impl Gallery {
    /// Make a gallery. Nothing is read yet.
    pub fn new(products: Vec<Product>, layers: Vec<Layer>, bounds: Bounds) -> Self {
        let each = bounds.overview_bytes / products.len().max(1) as u64;
        // A sub-aperture tile needs several FFTs of its patch.
        let looks = bounds.request_bytes >= look::MAX_BYTES;
        Self {
            shown: products
                .into_iter()
                .map(|mut product| {
                    product.aperture = product.aperture.filter(|_| looks);
                    Shown::new(product, each)
                })
                .collect(),
            layers,
            maps: Vec::new(),
            computing: Arc::new(Semaphore::new(bounds.computing.max(1))),
            answers: Arc::new(Semaphore::new(bounds.answer_kib() as usize)),
            encoding: Semaphore::new(1),
            bounds,
            begun: AtomicBool::new(false),
        }
    }

    /// Add sources of range-Doppler maps.
    pub fn with_maps(mut self, maps: Vec<Box<dyn DopplerMaps>>) -> Self {
        self.maps = maps;
        self
    }

    /// Start the reader thread, once. It ends when the gallery is dropped.
    pub(crate) fn begin(self: &Arc<Self>) -> io::Result<()> {
        if self.begun.swap(true, Ordering::SeqCst) {
            return Ok(());
        }
        let gallery = Arc::downgrade(self);
        let reader = thread::Builder::new().name("overview".to_owned());
        reader.spawn(move || read_all(&gallery)).map(drop)
    }

    pub(super) fn state(&self) -> Value {
        let images: Vec<Value> = self.shown.iter().map(Shown::about).collect();
        let layers: Vec<&str> = self
            .layers
            .iter()
            .map(|layer| layer.name.as_str())
            .collect();
        let maps = self.maps.iter().map(|maps| doppler::about(&**maps));
        let maps: Vec<Value> = maps.collect();
        json!({ "images": images, "layers": layers, "maps": maps })
    }
}

/// Read all previews, then all overviews, then the tiles of incomplete images as they arrive. Complete files are then
/// checked.
fn read_all(gallery: &Weak<Gallery>) {
    let Some((count, bounds)) = gallery.upgrade().map(|g| (g.shown.len(), g.bounds)) else {
        return;
    };
    let each = |what: &mut dyn FnMut(usize, &Shown)| -> bool {
        (0..count).all(|i| match gallery.upgrade() {
            Some(all) => {
                what(i, &all.shown[i]);
                true
            }
            None => false,
        })
    };
    // Pieces already read, per image.
    let mut has = vec![HashSet::new(); count];
    let looked = each(&mut |_, shown| {
        if let Err(error) = shown.look() {
            shown.fail(error.to_string());
        }
    });
    // Only this thread holds the gallery while it reads.
    let nobody_else = || gallery.strong_count() <= 1;
    let mut alive = looked;
    while alive {
        alive = each(&mut |i, shown| {
            if shown.state().settled {
                return;
            }
            match shown.take(&mut has[i], bounds.picture_bytes, &nobody_else) {
                Err(error) => shown.fail(error.to_string()),
                Ok(_) if has[i].len() == shown.product.pixels.num_pieces() => {
                    let fault = shown.product.check.as_ref().and_then(|check| check().err());
                    let mut state = shown.state();
                    state.fault = fault;
                    state.settled = true;
                    state.revision += 1;
                }
                Ok(_) => {}
            }
        });
        let settled = |g: Arc<Gallery>| g.shown.iter().all(|shown| shown.state().settled);
        if gallery.upgrade().is_none_or(settled) {
            return;
        }
        thread::sleep(EVERY);
    }
}
