//! What is answered to whom.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header;
use axum::middleware::from_fn;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::stream;
use tokio::time::{Instant, sleep};

use crate::Board;
use crate::guard::{colours, file, guard};
use crate::message::{Message, pixels};

/// How often a client is told, at the most.
const EVERY: Duration = Duration::from_millis(100);
/// How often it is told that nothing has changed.
const STILL_HERE: Duration = Duration::from_secs(5);

pub(crate) fn routes(board: Arc<Board>) -> Router {
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
        .route("/favicon.ico", get(|| async { StatusCode::NO_CONTENT }))
        .route("/colours", get(colours))
        .route("/events", get(events))
        .route("/picture", get(picture))
        .with_state(board)
        .layer(from_fn(guard))
}

async fn picture(State(board): State<Arc<Board>>) -> Response {
    match board.picture() {
        (Some(picture), _) => {
            let kind = [(header::CONTENT_TYPE, "application/octet-stream")];
            (kind, pixels(&picture)).into_response()
        }
        (None, _) => (StatusCode::NOT_FOUND, "There is no image yet.\n").into_response(),
    }
}

/// What a client has been told.
struct Told {
    board: Arc<Board>,
    revision: u64,
    sweep: Option<u64>,
    at: Option<Instant>,
}

async fn events(State(board): State<Arc<Board>>) -> impl IntoResponse {
    let told = Told {
        board,
        revision: 0,
        sweep: None,
        at: None,
    };
    // Asked for only when the connection has room: a slow client is told less often, and nothing waits for it.
    let events = stream::unfold(told, |mut told| async move {
        let event = told.next().await;
        Some((Ok::<_, Infallible>(event), told))
    });
    let kind = [(header::CONTENT_TYPE, "text/event-stream")];
    (kind, Body::from_stream(events))
}

impl Told {
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
        // Rows after the state: one that comes in between is of a later sweep than it says, and not told twice.
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
        // Numbers and text alone: there is nothing that cannot be written.
        let text = serde_json::to_string(&message).unwrap_or_default();
        Bytes::from(format!("data: {text}\n\n"))
    }
}
