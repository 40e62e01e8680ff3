//! HTTP routes of the capture page.

use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::stream;
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;
use tokio::time::{Instant, sleep};

use crate::LiveState;
use crate::guard::{colours, file};
use crate::message::{Message, pixels};

/// Minimum interval between events of a client.
const EVERY: Duration = Duration::from_millis(100);
/// Interval of keep-alive comments while nothing changes.
const STILL_HERE: Duration = Duration::from_secs(5);

/// Threads that encode responses: one for the image, one for events.
pub(crate) const CAPTURE_THREADS: usize = 2;

/// Capture, and the encoding of its responses.
struct Encoder {
    live: Arc<LiveState>,
    /// One permit each, so that an event does not wait for an image.
    pictures: Semaphore,
    events: Semaphore,
    /// Latest encoded image with its revision, shared by all clients.
    encoded: Mutex<Option<(u64, Bytes)>>,
}

impl Encoder {
    fn encoded(&self) -> Option<(u64, Bytes)> {
        let encoded = self.encoded.lock().unwrap_or_else(PoisonError::into_inner);
        encoded.clone()
    }

    /// Encoded image; `None` before the first.
    async fn picture(self: Arc<Self>) -> Option<Bytes> {
        let _permit = self.pictures.acquire().await.ok()?;
        let (picture, revision) = self.live.picture();
        let picture = picture?;
        if let Some((_, bytes)) = self.encoded().filter(|(of, _)| *of == revision) {
            return Some(bytes);
        }
        let encode = spawn_blocking(move || Bytes::from(pixels(&picture)));
        let bytes = encode.await.ok()?;
        let mut encoded = self.encoded.lock().unwrap_or_else(PoisonError::into_inner);
        *encoded = Some((revision, bytes.clone()));
        Some(bytes)
    }
}

pub(crate) fn routes(live: Arc<LiveState>) -> Router {
    let encoder = Arc::new(Encoder {
        live,
        pictures: Semaphore::new(1),
        events: Semaphore::new(1),
        encoded: Mutex::new(None),
    });
    Router::new()
        .route(
            "/",
            get(|| file("text/html; charset=utf-8", include_str!("page/index.html"))),
        )
        .route(
            "/page.css",
            get(|| file("text/css; charset=utf-8", include_str!("page/page.css"))),
        )
        .route(
            "/page.js",
            get(|| {
                file(
                    "text/javascript; charset=utf-8",
                    include_str!("page/page.js"),
                )
            }),
        )
        .route("/colours", get(colours))
        .route("/events", get(events))
        .route("/picture", get(picture))
        .with_state(encoder)
}

async fn picture(State(encoder): State<Arc<Encoder>>) -> Response {
    match encoder.picture().await {
        Some(bytes) => {
            let kind = [(header::CONTENT_TYPE, "application/octet-stream")];
            (kind, bytes).into_response()
        }
        None => (StatusCode::NOT_FOUND, "There is no image yet.\n").into_response(),
    }
}

/// Event stream of one client: what was sent last, and when.
struct ClientStream {
    encoder: Arc<Encoder>,
    revision: u64,
    sweep: Option<u64>,
    at: Option<Instant>,
}

async fn events(State(encoder): State<Arc<Encoder>>) -> impl IntoResponse {
    let client = ClientStream {
        encoder,
        revision: 0,
        sweep: None,
        at: None,
    };
    // The stream is polled only when the connection has room: a slow client receives fewer events and blocks nothing.
    let events = stream::unfold(client, |mut client| async move {
        let event = client.next().await;
        Some((Ok::<_, Infallible>(event), client))
    });
    let kind = [(header::CONTENT_TYPE, "text/event-stream")];
    (kind, Body::from_stream(events))
}

impl ClientStream {
    async fn next(&mut self) -> Bytes {
        loop {
            let due = self.at.map(|at| at + EVERY);
            if let Some(due) = due {
                tokio::time::sleep_until(due).await;
            }
            if self.encoder.live.revision() != self.revision {
                self.at = Some(Instant::now());
                return self.changed().await;
            }
            if self.at.is_some_and(|at| at.elapsed() >= STILL_HERE) {
                self.at = Some(Instant::now());
                return Bytes::from_static(b": still here\n\n");
            }
            sleep(EVERY).await;
        }
    }

    async fn changed(&mut self) -> Bytes {
        let _permit = self.encoder.events.acquire().await;
        let (live, last) = (Arc::clone(&self.encoder.live), self.sweep);
        let encoded = spawn_blocking(move || event(&live, last)).await;
        let Ok((bytes, revision, sweep)) = encoded else {
            return Bytes::from_static(b": no event\n\n");
        };
        self.revision = revision;
        self.sweep = sweep.or(self.sweep);
        bytes
    }
}

/// Event with the rows after sweep `last`; its revision, and its last sweep.
fn event(live: &LiveState, last: Option<u64>) -> (Bytes, u64, Option<u64>) {
    // Rows are read after the state: a row added in between belongs to a later sweep than the state, and is not
    // sent twice.
    let (status, revision) = live.status();
    let rows = live.rows_after(last);
    let (picture, picture_revision) = live.picture();
    let picture = picture
        .as_deref()
        .map(|picture| (picture, picture_revision));
    let message = Message::new(&status, &rows, live.most_rows(), picture);
    // The message holds numbers and text only, so serialization cannot fail.
    let text = serde_json::to_string(&message).unwrap_or_default();
    let sweep = rows.last().map(|row| row.sweep);
    (Bytes::from(format!("data: {text}\n\n")), revision, sweep)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use subaperture_radio::live::{MAX_PIXELS, Picture, Status};

    use super::*;

    /// Another task makes progress while images of a million pixels and their events are encoded: the thread that serves other requests is free. Encoding on
    /// that thread would never yield to the task. Each of ten encodings takes milliseconds, so that not all can end before they are first waited for.
    #[test]
    fn other_requests_are_served_while_images_are_encoded() {
        let live = Arc::new(LiveState::new(Status::default(), 8));
        let encoder = Arc::new(Encoder {
            live: Arc::clone(&live),
            pictures: Semaphore::new(1),
            events: Semaphore::new(1),
            encoded: Mutex::new(None),
        });
        let mut client = ClientStream {
            encoder: Arc::clone(&encoder),
            revision: 0,
            sweep: None,
            at: None,
        };
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime
            .max_blocking_threads(CAPTURE_THREADS)
            .build()
            .unwrap();
        let count = Arc::new(AtomicUsize::new(0));
        let progress = |before: &mut usize| {
            let now = count.load(Ordering::Relaxed);
            let more = now - *before;
            *before = now;
            more
        };
        runtime.block_on(async {
            let counted = Arc::clone(&count);
            tokio::spawn(async move {
                loop {
                    counted.fetch_add(1, Ordering::Relaxed);
                    tokio::task::yield_now().await;
                }
            });
            let (mut before, mut pictures, mut events) = (0, 0, 0);
            for n in 0..10 {
                live.show_picture(Picture {
                    columns: 1024,
                    x_m: [0.0, 1.0],
                    y_m: [0.0, 1.0],
                    levels_db: vec![n as f32; MAX_PIXELS],
                    pulses: n,
                });
                progress(&mut before);
                let bytes = Arc::clone(&encoder).picture().await.unwrap();
                pictures += progress(&mut before);
                assert_eq!(bytes.len(), 2 * MAX_PIXELS);
                assert_eq!(bytes[..2], (10 * n as i16).to_le_bytes());
                // The second client shares the first one's bytes.
                let again = Arc::clone(&encoder).picture().await.unwrap();
                assert_eq!(again.as_ptr(), bytes.as_ptr());
                progress(&mut before);
                let event = client.changed().await;
                events += progress(&mut before);
                let text = std::str::from_utf8(&event).unwrap();
                assert!(text.contains(&format!("\"pulses\":{n}")), "{text}");
            }
            assert!(pictures > 0 && events > 0, "{pictures} {events}");
        });
    }
}
