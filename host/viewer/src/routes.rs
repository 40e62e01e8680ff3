//! HTTP routes of the capture page.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::stream;
use tokio::time::{Instant, sleep};

use crate::LiveState;
use crate::guard::{colours, file};
use crate::message::{Message, pixels};

/// Minimum interval between events of a client.
const EVERY: Duration = Duration::from_millis(100);
/// Interval of keep-alive comments while nothing changes.
const STILL_HERE: Duration = Duration::from_secs(5);

pub(crate) fn routes(board: Arc<LiveState>) -> Router {
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
        .with_state(board)
}

async fn picture(State(board): State<Arc<LiveState>>) -> Response {
    match board.picture() {
        (Some(picture), _) => {
            let kind = [(header::CONTENT_TYPE, "application/octet-stream")];
            (kind, pixels(&picture)).into_response()
        }
        (None, _) => (StatusCode::NOT_FOUND, "There is no image yet.\n").into_response(),
    }
}

/// Event stream of one client: what was sent last, and when.
struct ClientStream {
    board: Arc<LiveState>,
    revision: u64,
    sweep: Option<u64>,
    at: Option<Instant>,
}

async fn events(State(board): State<Arc<LiveState>>) -> impl IntoResponse {
    let client = ClientStream {
        board,
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
            if self.board.revision() != self.revision {
                self.at = Some(Instant::now());
                return self.changed();
            }
            if self.at.is_some_and(|at| at.elapsed() >= STILL_HERE) {
                self.at = Some(Instant::now());
                return Bytes::from_static(b": still here\n\n");
            }
            sleep(EVERY).await;
        }
    }

    fn changed(&mut self) -> Bytes {
        // Rows are read after the state: a row added in between belongs to a later sweep than the state, and is not
        // sent twice.
        let (status, revision) = self.board.status();
        let rows = self.board.rows_after(self.sweep);
        let (picture, picture_revision) = self.board.picture();
        self.revision = revision;
        if let Some(row) = rows.last() {
            self.sweep = Some(row.sweep);
        }
        let picture = picture
            .as_deref()
            .map(|picture| (picture, picture_revision));
        let message = Message::new(&status, &rows, self.board.most_rows(), picture);
        // The message holds numbers and text only, so serialization cannot fail.
        let text = serde_json::to_string(&message).unwrap_or_default();
        Bytes::from(format!("data: {text}\n\n"))
    }
}
