//! A page on which several rigs are watched: a table of them, the cloud of one, and a button for each of its modes where orders are allowed.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde_json::Value;

use crate::error::PanelError;
use crate::guard::Access;
use crate::server::{Serving, claim, file, refused, serve_router};
use crate::streams::Outgoing;

/// The rigs that a page shows.
pub trait RigsOnPage: Send + Sync + 'static {
    /// All that is known of them, with `rigs` as a list and `may_order`.
    fn rigs(&self) -> Value;

    /// The newest cloud of one, as [`cloud_message`](crate::cloud_message) makes it.
    fn cloud(&self, rig: &str) -> Option<Outgoing>;

    /// Sends one to a mode, and waits until it is there.
    ///
    /// # Errors
    /// A sentence where it refuses, or does not arrive.
    fn order(&self, rig: &str, mode: &str) -> Result<(), String>;
}

type Served = State<Arc<dyn RigsOnPage>>;

/// Rigs on other machines are shown on this computer alone.
const ACCESS: Access = Access::ThisComputer;

/// Serves the page of `rigs` to this computer until the result is dropped.
///
/// # Errors
/// [`PanelError::OnlyHere`], [`PanelError::Listen`], [`PanelError::Server`]
pub fn serve_rigs(rigs: Arc<dyn RigsOnPage>, address: SocketAddr) -> Result<Serving, PanelError> {
    if !address.ip().is_loopback() {
        return Err(PanelError::OnlyHere(address));
    }
    let listener = TcpListener::bind(address);
    let listener = listener.map_err(|error| PanelError::Listen { address, why: error.to_string() })?;
    let router = Router::new()
        .route("/rigs", get(list))
        .route("/rigs/{rig}/cloud", get(cloud))
        .route("/rigs/{rig}/mode/{mode}", post(order))
        .fallback(get(page))
        .with_state(rigs);
    serve_router(router, listener, &ACCESS, std::future::pending())
}

async fn page(uri: Uri) -> Response {
    let uri = if uri.path() == "/" { Uri::from_static("/rigs.html") } else { uri };
    file(uri).await
}

async fn list(State(rigs): Served, headers: HeaderMap, uri: Uri) -> Response {
    match ACCESS.check_reader(&claim(&headers, &uri)) {
        Ok(()) => ([(header::CONTENT_TYPE, "application/json")], rigs.rigs().to_string()).into_response(),
        Err(why) => refused(why),
    }
}

async fn cloud(State(rigs): Served, Path(rig): Path<String>, headers: HeaderMap, uri: Uri) -> Response {
    if let Err(why) = ACCESS.check_reader(&claim(&headers, &uri)) {
        return refused(why);
    }
    match rigs.cloud(&rig) {
        Some(Outgoing::Binary(bytes)) => bytes.into_response(),
        _ => (StatusCode::NOT_FOUND, "no cloud of this rig yet").into_response(),
    }
}

async fn order(
    State(rigs): Served,
    Path((rig, mode)): Path<(String, String)>,
    headers: HeaderMap,
    uri: Uri,
) -> Response {
    if let Err(why) = ACCESS.check_page(&claim(&headers, &uri)) {
        return refused(why);
    }
    let ordered = tokio::task::spawn_blocking(move || rigs.order(&rig, &mode));
    match ordered.await {
        Ok(Ok(())) => StatusCode::NO_CONTENT.into_response(),
        Ok(Err(why)) => (StatusCode::CONFLICT, why).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}
