//! All that is shown, and the thread that makes the overviews.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::Semaphore;

use super::shown::Shown;
use super::{DopplerMaps, Layer, Product, doppler};

/// How often an image that is still growing is looked at.
const EVERY: Duration = Duration::from_millis(700);

/// What showing may take.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Bytes of all overviews together. One that fits a tile is kept in any case.
    pub overview_bytes: u64,
    /// Requests that are computed at once.
    pub computing: usize,
}

/// Images and layers, as a [`crate::Server`] shows them.
pub struct Gallery {
    pub(super) shown: Vec<Shown>,
    pub(super) layers: Vec<Layer>,
    pub(super) maps: Vec<Box<dyn DopplerMaps>>,
    pub(super) computing: Arc<Semaphore>,
    begun: AtomicBool,
}

impl std::fmt::Debug for Gallery {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<&str> = self.shown.iter().map(|s| s.product.name.as_str()).collect();
        f.debug_struct("Gallery").field("images", &names).finish()
    }
}

impl Gallery {
    /// Images and layers; nothing is read yet.
    pub fn new(products: Vec<Product>, layers: Vec<Layer>, bounds: Bounds) -> Self {
        let each = bounds.overview_bytes / products.len().max(1) as u64;
        Self {
            shown: products
                .into_iter()
                .map(|product| Shown::new(product, each))
                .collect(),
            layers,
            maps: Vec::new(),
            computing: Arc::new(Semaphore::new(bounds.computing.max(1))),
            begun: AtomicBool::new(false),
        }
    }

    /// With range-Doppler maps beside the images.
    pub fn with_maps(mut self, maps: Vec<Box<dyn DopplerMaps>>) -> Self {
        self.maps = maps;
        self
    }

    /// Starts the thread that reads, once. It ends when nobody has the gallery any more.
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

/// First looks, then overviews, then what grows; then files are checked.
fn read_all(gallery: &Weak<Gallery>) {
    let Some(count) = gallery.upgrade().map(|g| g.shown.len()) else {
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
    let pieces = |g: Arc<Gallery>| -> Vec<Vec<bool>> {
        let each = g.shown.iter();
        each.map(|shown| vec![false; shown.product.pixels.num_pieces()])
            .collect()
    };
    let Some(mut has) = gallery.upgrade().map(pieces) else {
        return;
    };
    let looked = each(&mut |_, shown| {
        if let Err(error) = shown.look() {
            shown.fail(error.to_string());
        }
    });
    // This thread's own hold on it, while it reads.
    let nobody_else = || gallery.strong_count() <= 1;
    let mut alive = looked;
    while alive {
        alive = each(&mut |i, shown| {
            if shown.state().settled {
                return;
            }
            match shown.take(&mut has[i], &nobody_else) {
                Err(error) => shown.fail(error.to_string()),
                Ok(_) if has[i].iter().all(|&has| has) => {
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
