//! What all pages have in common: who is answered, and the headers of every answer.

use axum::extract::Request;
use axum::http::StatusCode;
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use subaperture_plot::Colours;

use crate::host::may_ask;

/// Headers of every answer: nothing is loaded but from here, nobody frames it, nothing of it is kept.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        "same-origin",
    ),
];

/// Serves those who mean this server.
pub(crate) async fn guard(request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST);
    let mut answer = match host
        .and_then(|host| host.to_str().ok())
        .is_some_and(may_ask)
    {
        true => next.run(request).await,
        false => {
            let what = "This page answers to localhost and to addresses in digits, as http://127.0.0.1:8080/, by no other name.\n";
            (StatusCode::MISDIRECTED_REQUEST, what).into_response()
        }
    };
    for (name, value) in HEADERS {
        answer
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    answer
}

/// A file that is in the program.
pub(crate) async fn file(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, kind)], text)
}

/// Colour maps: 256 colours each, from the lowest level to the highest.
pub(crate) async fn colours() -> impl IntoResponse {
    let maps = serde_json::json!({
        "viridis": Colours::Viridis.table(),
        "grey": Colours::Grey.table(),
    });
    (
        [(header::CONTENT_TYPE, "application/json")],
        maps.to_string(),
    )
}
