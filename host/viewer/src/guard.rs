//! Parts common to all pages: access checks, and the headers of every response.

use axum::Router;
use axum::extract::Request;
use axum::http::StatusCode;
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};
use subaperture_plot::Colours;
use tower::ServiceExt;

use crate::admission::Seat;
use crate::host::may_ask;
use crate::secret::Secret;

/// Headers of every response: only same-origin resources, no framing, no caching.
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

/// Answer requests that name this server and carry its secret.
pub(crate) async fn answer(
    routes: &Router,
    secret: &Secret,
    seat: &Seat,
    mut request: Request,
) -> Response {
    let host = request.headers().get(header::HOST);
    let is_meant = host
        .and_then(|host| host.to_str().ok())
        .is_some_and(may_ask);
    let path = request.uri().path();
    let query = request.uri().query().map(|query| format!("?{query}"));
    let own = secret
        .strip(path)
        .map(|own| own.to_owned() + &query.unwrap_or_default());
    let mut answer = match own {
        _ if !is_meant => {
            let what = "This page is served under localhost and numeric addresses only, for example http://127.0.0.1:8080/.\n";
            (StatusCode::MISDIRECTED_REQUEST, what).into_response()
        }
        Some(own) => {
            seat.is_known();
            match own.parse() {
                Ok(uri) => {
                    *request.uri_mut() = uri;
                    let Ok(answer) = routes.clone().oneshot(request).await;
                    answer
                }
                Err(_) => StatusCode::NOT_FOUND.into_response(),
            }
        }
        // Browsers request it unprompted.
        None if path == "/favicon.ico" => StatusCode::NO_CONTENT.into_response(),
        None => {
            let what = "Access denied: open the whole address that the program printed. It contains a secret.\n";
            (StatusCode::FORBIDDEN, [(header::CONNECTION, "close")], what).into_response()
        }
    };
    for (name, value) in HEADERS {
        answer
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    answer
}

/// Serve a file embedded in the program.
pub(crate) async fn file(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, kind)], text)
}

/// Colour maps of 256 colours each, from the lowest level to the highest.
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
