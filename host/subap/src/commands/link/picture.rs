//! Picture of the partial image, drawn in a thread of its own so that the transfer never waits.

use std::io::Write;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context;
use subaperture::geometry::ImageGrid;
use subaperture::io::atomic::write_atomically;
use subaperture::module::link::RunningImage;
use subaperture::module::maps::OwnedMap;
use subaperture::plot::{self, Panel};

/// Minimum time between two pictures.
const PERIOD: Duration = Duration::from_secs(1);

/// Maximum number of maps queued for the thread; further maps are left out of the picture.
const WAITING: usize = 64;

/// Picture that is updated during the transfer.
pub(crate) struct Picture {
    maps: SyncSender<OwnedMap>,
    /// Number of maps left out because the queue was full.
    left_out: u64,
    thread: JoinHandle<anyhow::Result<()>>,
}

impl Picture {
    /// Start a picture at `path`, which must be claimed.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub(crate) fn start(
        path: &Path,
        image: RunningImage,
        grid: &ImageGrid,
        title: String,
    ) -> anyhow::Result<Self> {
        let (sender, receiver) = sync_channel(WAITING);
        let (path, grid) = (path.to_owned(), grid.clone());
        let thread = std::thread::Builder::new()
            .spawn(move || draw(&path, image, &grid, &title, &receiver))
            .context("cannot start a thread for the picture; leave the picture out, or allow more threads")?;
        Ok(Self {
            maps: sender,
            left_out: 0,
            thread,
        })
    }

    /// Queue a map; it is dropped if the queue is full.
    pub(crate) fn take(&mut self, map: OwnedMap) {
        self.left_out += u64::from(self.maps.try_send(map).is_err());
    }

    /// Draw the last picture. Returns the number of maps left out of it.
    pub(crate) fn finish(self) -> anyhow::Result<u64> {
        drop(self.maps);
        match self.thread.join() {
            Ok(drawn) => drawn.map(|()| self.left_out),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

fn draw(
    path: &Path,
    mut image: RunningImage,
    grid: &ImageGrid,
    title: &str,
    maps: &Receiver<OwnedMap>,
) -> anyhow::Result<()> {
    let mut drawn = Instant::now();
    loop {
        let wait = PERIOD.saturating_sub(drawn.elapsed());
        let over = match maps.recv_timeout(wait) {
            Ok(map) => {
                image.take(map);
                if drawn.elapsed() < PERIOD {
                    continue;
                }
                false
            }
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        if let Some(so_far) = image.form().context("--picture")? {
            let picture = plot::quicklook(&Panel::new(&so_far, grid, title))?;
            write_atomically(path, picture.len() as u64, |file| file.write_all(&picture))
                .context("--picture")?;
        }
        if over {
            return Ok(());
        }
        drawn = Instant::now();
    }
}
