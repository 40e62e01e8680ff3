//! HTTP routes of the image viewer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde_json::Value;
use subaperture_model::image::ImageSourceError;
use tokio::sync::OwnedSemaphorePermit;

use super::shown::Shown;
use super::tile::encode;
use super::{Gallery, cut, doppler, look, point, region};
use crate::guard::{colours, file};

type All = State<Arc<Gallery>>;

/// Maximum search radius for the brightest pixel, pixels.
const MAX_SEARCHED: usize = 64;

const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

pub(crate) fn product_routes(gallery: Arc<Gallery>) -> Router {
    let page = include_str!("page/index.html");
    let licences = include_str!("page/leaflet/LICENSE");
    Router::new()
        .route("/", get(move || file("text/html; charset=utf-8", page)))
        .route(
            "/view.css",
            get(|| file(STYLE, include_str!("page/view.css"))),
        )
        .route(
            "/view.js",
            get(|| file(SCRIPT, include_str!("page/view.js"))),
        )
        .route(
            "/histogram.js",
            get(|| file(SCRIPT, include_str!("page/histogram.js"))),
        )
        .route(
            "/axes.js",
            get(|| file(SCRIPT, include_str!("page/axes.js"))),
        )
        .route(
            "/measure.js",
            get(|| file(SCRIPT, include_str!("page/measure.js"))),
        )
        .route(
            "/region.js",
            get(|| file(SCRIPT, include_str!("page/region.js"))),
        )
        .route(
            "/doppler.js",
            get(|| file(SCRIPT, include_str!("page/doppler.js"))),
        )
        .route(
            "/leaflet.css",
            get(|| file(STYLE, include_str!("page/leaflet/leaflet.css"))),
        )
        .route(
            "/leaflet.js",
            get(|| file(SCRIPT, include_str!("page/leaflet/leaflet.js"))),
        )
        .route(
            "/licences",
            get(move || file("text/plain; charset=utf-8", licences)),
        )
        .route("/colours", get(colours))
        .route("/state", get(state))
        .route("/tile/{image}/{level}/{row}/{column}", get(tile))
        .route("/phase/{image}/{row}/{column}", get(phase))
        .route(
            "/look/{image}/{from}/{to}/{level}/{row}/{column}",
            get(part),
        )
        .route("/value/{image}/{row}/{column}", get(value))
        .route(
            "/cut/{image}/{row}/{column}/{to_row}/{to_column}",
            get(along),
        )
        .route(
            "/statistics/{image}/{row}/{column}/{to_row}/{to_column}",
            get(statistics),
        )
        .route("/point/{image}/{row}/{column}/{search}", get(response))
        .route(
            "/doppler/{maps}/{sub_cpi}/{image}/{row}/{column}",
            get(doppler_map),
        )
        .route("/layer/{layer}/{image}", get(layer))
        .with_state(gallery)
}

/// Result of a request.
enum Answer {
    Bytes(Vec<u8>),
    Json(Value),
    /// Serialized JSON.
    Text(String),
    /// The resource does not exist.
    None,
    /// The request cannot be answered for this image, with the reason.
    Refused(String),
}

impl From<Option<Vec<u8>>> for Answer {
    fn from(bytes: Option<Vec<u8>>) -> Self {
        bytes.map_or(Self::None, Self::Bytes)
    }
}

impl Answer {
    /// Status, content type and bytes.
    fn sent(self) -> Sent {
        let (status, kind, bytes) = match self {
            Self::Bytes(bytes) => (StatusCode::OK, "application/octet-stream", bytes),
            Self::Json(value) => (StatusCode::OK, JSON, value.to_string().into_bytes()),
            Self::Text(text) => (StatusCode::OK, JSON, text.into_bytes()),
            Self::None => {
                let what = b"Not found: no such image or tile.\n".to_vec();
                (StatusCode::NOT_FOUND, TEXT, what)
            }
            Self::Refused(why) => (StatusCode::UNPROCESSABLE_ENTITY, TEXT, why.into_bytes()),
        };
        Sent {
            status,
            kind,
            bytes,
        }
    }
}

const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";

/// Response as bytes.
struct Sent {
    status: StatusCode,
    kind: &'static str,
    bytes: Vec<u8>,
}

/// Bytes being sent to a client, with their share of the response memory.
struct BytesInFlight {
    bytes: Vec<u8>,
    _share: OwnedSemaphorePermit,
}

impl AsRef<[u8]> for BytesInFlight {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl Sent {
    /// Make the response at once. Only for short ones: their memory is bounded by the number of connections.
    fn at_once(self) -> Response {
        (self.status, [(header::CONTENT_TYPE, self.kind)], self.bytes).into_response()
    }

    /// Make the response as soon as memory for it is available.
    async fn response(self, gallery: &Gallery) -> Response {
        let kib = u32::try_from(self.bytes.len() >> 10).unwrap_or(u32::MAX);
        let kib = (kib + 1).min(gallery.bounds.answer_kib());
        let Ok(share) = Arc::clone(&gallery.answers).acquire_many_owned(kib).await else {
            return StatusCode::SERVICE_UNAVAILABLE.into_response();
        };
        let body = Bytes::from_owner(BytesInFlight {
            bytes: self.bytes,
            _share: share,
        });
        (self.status, [(header::CONTENT_TYPE, self.kind)], body).into_response()
    }
}

/// Compute on a separate thread, within the limit on concurrent computations.
async fn compute(
    gallery: Arc<Gallery>,
    image: usize,
    work: impl FnOnce(&Gallery, &Shown) -> Result<Answer, ImageSourceError> + Send + 'static,
) -> Response {
    let Ok(place) = Arc::clone(&gallery.computing).acquire_owned().await else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    let all = Arc::clone(&gallery);
    // The permit belongs to the computation, also if the client closes the connection before it ends.
    let done = tokio::task::spawn_blocking(move || {
        let answer = match gallery.shown.get(image) {
            Some(shown) => work(&gallery, shown),
            None => Ok(Answer::None),
        };
        (answer.map(Answer::sent), place)
    });
    // The permit is held until the response has its memory, since the result waits for it.
    match done.await {
        Ok((Ok(sent), _place)) => sent.response(&all).await,
        Ok((Err(error), _place)) => {
            (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response()
        }
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

/// State of all images. It waits neither for tiles being computed nor for tiles being sent.
async fn state(State(all): All) -> Response {
    let Ok(_permit) = all.encoding.acquire().await else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    let gallery = Arc::clone(&all);
    let done = tokio::task::spawn_blocking(move || Answer::Json(gallery.state()).sent());
    match done.await {
        Ok(sent) => sent.at_once(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn tile(
    State(all): All,
    Path((image, level, row, column)): Path<(usize, u32, usize, usize)>,
) -> Response {
    let work = move |_: &Gallery, shown: &Shown| Ok(shown.tile(level, [row, column])?.into());
    compute(all, image, work).await
}

async fn phase(
    State(all): All,
    Path((image, row, column)): Path<(usize, usize, usize)>,
) -> Response {
    let work = move |_: &Gallery, shown: &Shown| Ok(shown.phases([row, column])?.into());
    compute(all, image, work).await
}

async fn part(
    State(all): All,
    Path((image, from, to, level, row, column)): Path<(usize, u16, u16, u32, usize, usize)>,
) -> Response {
    if from >= to || to > 1000 {
        return StatusCode::NOT_FOUND.into_response();
    }
    let part = [from, to].map(|thousandths| f64::from(thousandths) / 1000.0);
    let work = move |_: &Gallery, shown: &Shown| {
        let product = &shown.product;
        let Some(aperture) = &product.aperture else {
            return Ok(Answer::None);
        };
        let (pixels, grid) = (&product.pixels, product.any_grid());
        let found = look::powers(pixels, &grid, aperture, part, (level, [row, column]))?;
        Ok(found.map(|(place, powers)| encode(&place, &powers)).into())
    };
    compute(all, image, work).await
}

async fn value(
    State(all): All,
    Path((image, row, column)): Path<(usize, usize, usize)>,
) -> Response {
    let work = move |_: &Gallery, shown: &Shown| match row < shown.size[0] && column < shown.size[1]
    {
        true => point::value(&shown.product, [row, column]).map(Answer::Json),
        false => Ok(Answer::None),
    };
    compute(all, image, work).await
}

async fn along(
    State(all): All,
    Path((image, row, column, to_row, to_column)): Path<(usize, f64, f64, f64, f64)>,
) -> Response {
    let ends = [[row, column], [to_row, to_column]];
    let near = ends.iter().flatten().all(|x| x.abs() <= 1e9);
    let work = move |_: &Gallery, shown: &Shown| match near {
        true => cut::along(&shown.product.pixels, ends).map(Answer::Json),
        false => Ok(Answer::None),
    };
    compute(all, image, work).await
}

/// Sets its flag when dropped: the client has closed the connection, or has its response.
struct Ended(Arc<AtomicBool>);

impl Drop for Ended {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

async fn statistics(
    State(all): All,
    Path((image, row, column, to_row, to_column)): Path<(usize, usize, usize, usize, usize)>,
) -> Response {
    let flag = Arc::new(AtomicBool::new(false));
    let _ended = Ended(Arc::clone(&flag));
    let work = move |_: &Gallery, shown: &Shown| {
        let place = [
            row..to_row.min(shown.size[0]),
            column..to_column.min(shown.size[1]),
        ];
        if place.iter().any(|range| range.is_empty()) {
            return Ok(Answer::None);
        }
        let stop = || flag.load(Ordering::Relaxed);
        let found = region::statistics(&shown.product.pixels, &place, &stop)?;
        Ok(found.map_or(Answer::None, |found| Answer::Json(found.to_json())))
    };
    compute(all, image, work).await
}

async fn response(
    State(all): All,
    Path((image, row, column, search)): Path<(usize, usize, usize, usize)>,
) -> Response {
    let work = move |all: &Gallery, shown: &Shown| {
        if row >= shown.size[0] || column >= shown.size[1] {
            return Ok(Answer::None);
        }
        let found = point::response(
            &shown.product,
            [row, column],
            search.min(MAX_SEARCHED),
            all.bounds.request_bytes,
        );
        Ok(match found {
            Ok(found) => Answer::Json(found),
            Err(error) => Answer::Refused(error.to_string()),
        })
    };
    compute(all, image, work).await
}

async fn layer(State(all): All, Path((layer, image)): Path<(usize, usize)>) -> Response {
    let work = move |all: &Gallery, shown: &Shown| {
        let found = all.layers.get(layer);
        Ok(found.map_or(Answer::None, |layer| {
            Answer::Text(layer.over(&shown.product))
        }))
    };
    compute(all, image, work).await
}

async fn doppler_map(
    State(all): All,
    Path((maps, sub_cpi, image, row, column)): Path<(usize, usize, usize, usize, usize)>,
) -> Response {
    let work = move |all: &Gallery, shown: &Shown| {
        let maps = all.maps.get(maps).filter(|maps| sub_cpi < maps.sub_cpis());
        let within = row < shown.size[0] && column < shown.size[1];
        let Some(maps) = maps.filter(|_| within) else {
            return Ok(Answer::None);
        };
        let found = doppler::map(&**maps, sub_cpi, &shown.product, [row, column]);
        Ok(match found {
            Ok(found) => Answer::Json(found),
            Err(error) => Answer::Refused(error.to_string()),
        })
    };
    compute(all, image, work).await
}
