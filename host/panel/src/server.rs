//! The server: a thread of its own, with a runtime of its own, so that pages never delay the rig.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::{State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderName, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use tokio::sync::oneshot;
use tokio::time::{MissedTickBehavior, interval};
use vergence_board::{fresh_secret, hex};

use crate::assets::{asset, secured};
use crate::connection::{follow_view, serve_page};
use crate::error::PanelError;
use crate::guard::{Access, Claim, Refused};
use crate::hub::Hub;
use crate::pictures::show_pictures;
use crate::streams::{Outgoing, Stream};

/// Largest message of a page, in bytes.
const LARGEST_MESSAGE: usize = 16 * 1024;
/// The name of the threads that serve pages, as `/proc/PID/task/TID/comm` tells it.
const THREADS: &str = "panel";
/// How often it is checked whether the page that drives is silent.
const CHECK: Duration = Duration::from_millis(100);

/// A panel that is served; dropping it closes all pages.
pub struct Serving {
    address: SocketAddr,
    url: String,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Serving {
    /// The address that is listened on.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address to open in a browser, with the token where one is needed.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // Dropping the sender ends the thread.
        drop(self.end.take());
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has ended too.
            let _ = thread.join();
        }
    }
}

/// What accepts connections at `address`, and who may connect: this computer alone, or on a `network` who knows a token that is new each time.
///
/// # Errors
/// [`PanelError::Listen`], [`PanelError::OtherComputers`]
pub fn listen(address: SocketAddr, network: bool) -> Result<(TcpListener, Access), PanelError> {
    let access = match (network, address.ip().is_loopback()) {
        (true, _) => {
            let secret = fresh_secret().map_err(|error| PanelError::Server(error.to_string()))?;
            Access::Token(hex(&secret.public().0[..16]))
        }
        (false, true) => Access::ThisComputer,
        (false, false) => return Err(PanelError::OtherComputers(address)),
    };
    let listener = TcpListener::bind(address);
    let listener = listener.map_err(|error| PanelError::Listen { address, why: error.to_string() })?;
    Ok((listener, access))
}

/// What every request needs.
#[derive(Clone)]
struct Served {
    hub: Arc<Hub>,
    access: Arc<Access>,
}

/// Serves the page of a rig until the result is dropped.
pub fn serve(hub: Arc<Hub>, listener: TcpListener, access: Access) -> Result<Serving, PanelError> {
    let url = access.clone();
    let served = Served { hub: Arc::clone(&hub), access: Arc::new(access) };
    let router = Router::new()
        .route("/socket", any(socket))
        .route("/status", get(status))
        .fallback(get(file))
        .with_state(served);
    let beside = async move {
        tokio::select! {
            () = show_pictures(Arc::clone(&hub)) => {}
            () = follow_view(Arc::clone(&hub)) => {}
            () = watch_driver(&hub) => {}
        }
    };
    serve_router(router, listener, &url, beside)
}

/// Serves `router` on a thread of its own, with `beside` going on there, until the result is dropped.
pub fn serve_router(
    router: Router,
    listener: TcpListener,
    access: &Access,
    beside: impl Future<Output = ()> + Send + 'static,
) -> Result<Serving, PanelError> {
    let failed = |error: std::io::Error| PanelError::Server(error.to_string());
    let address = listener.local_addr().map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    // What pages cost is what the threads of this name take.
    let runtime = tokio::runtime::Builder::new_current_thread().thread_name(THREADS).enable_all().build();
    let runtime = runtime.map_err(failed)?;
    let (end, ended) = oneshot::channel::<()>();
    let url = match access {
        Access::Token(token) => format!("http://{address}/?token={token}"),
        Access::ThisComputer => format!("http://{address}/"),
    };
    let thread = std::thread::Builder::new().name(THREADS.to_owned()).spawn(move || {
        runtime.block_on(async {
            // Only a listener whose descriptor is closed is refused here, and it is open.
            let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
            tokio::select! {
                _ = axum::serve(listener, router) => {}
                () = beside => {}
                _ = ended => {}
            }
        });
        // A computation that a page asked for must not hold up the end.
        runtime.shutdown_background();
    });
    Ok(Serving { address, url, end: Some(end), thread: Some(thread.map_err(failed)?) })
}

async fn watch_driver(hub: &Hub) {
    let mut check = interval(CHECK);
    check.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        check.tick().await;
        hub.drop_silent();
    }
}

/// What the headers and the address of a request claim. The token is made of letters and digits, so that nothing in it is escaped.
pub fn claim<'a>(headers: &'a HeaderMap, uri: &'a Uri) -> Claim<'a> {
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    let pairs = uri.query().into_iter().flat_map(|query| query.split('&'));
    let token = pairs.filter_map(|pair| pair.strip_prefix("token=")).next();
    Claim { host: text(header::HOST), origin: text(header::ORIGIN), token }
}

pub fn refused(why: Refused) -> Response {
    (StatusCode::FORBIDDEN, why.to_string()).into_response()
}

async fn socket(State(served): State<Served>, headers: HeaderMap, uri: Uri, upgrade: WebSocketUpgrade) -> Response {
    if let Err(why) = served.access.check_page(&claim(&headers, &uri)) {
        return refused(why);
    }
    let Some(client) = served.hub.join() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open: close one").into_response();
    };
    let gone = Arc::clone(&served.hub);
    upgrade
        .max_message_size(LARGEST_MESSAGE)
        .on_failed_upgrade(move |_| gone.leave(client))
        .on_upgrade(move |socket| serve_page(served.hub, client, socket))
}

/// The latest status, for scripts.
async fn status(State(served): State<Served>, headers: HeaderMap, uri: Uri) -> Response {
    if let Err(why) = served.access.check_reader(&claim(&headers, &uri)) {
        return refused(why);
    }
    match served.hub.latest(Stream::Status) {
        Some(Outgoing::Text(text)) => ([(header::CONTENT_TYPE, "application/json")], text.to_string()).into_response(),
        _ => (StatusCode::SERVICE_UNAVAILABLE, "the board has said nothing yet").into_response(),
    }
}

/// The page and its parts, which hold nothing of the rig.
pub async fn file(uri: Uri) -> Response {
    match asset(uri.path()) {
        Some((content_type, text)) => secured(content_type, text),
        None => (StatusCode::NOT_FOUND, "the panel has no such file").into_response(),
    }
}
