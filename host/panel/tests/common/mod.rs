//! A simulated rig with a panel in this process, and pages that speak to it over real sockets.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use nalgebra::Matrix3;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::runtime::Builder;
use tokio::sync::oneshot;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};
use vergence_board::{Board, Shared};
use vergence_live::{LiveResult, Measurement, Totals};
use vergence_panel::{Access, Panel, Serving, Setting};
use vergence_pipeline::{ColouredPoint, Observation, PairCloud};
use vergence_protocol::SessionId;
use vergence_rig::{BENCH_TOML, BoardInstant, Rig};
use vergence_sim::SimulatedRig;
use vergence_vision::{Angle, CloudPoint, Length, Pixel, PixelPair, Point};

/// Longest wait for anything that should happen; the machine may be busy.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// A bench in simulation, in real time, with its panel.
pub struct Bench {
    pub panel: Panel,
    pub rig: Arc<Rig>,
    pub address: SocketAddr,
    pub access: Access,
    _serving: Serving,
    /// The board ends when this is dropped.
    _end: oneshot::Sender<()>,
}

impl Bench {
    pub fn start(access: Access) -> Self {
        let rig = Arc::new(Rig::from_toml(BENCH_TOML).expect("the bench"));
        let simulated = Some("all".into());
        let setting = Setting { rig: Arc::clone(&rig), simulated, has_cameras: false, recorded_ms: None };
        let (panel, mut driver) = Panel::new(setting);
        let (end, ended) = oneshot::channel();
        let (drawn, shown) = (Rig::clone(&rig), panel.clone());
        std::thread::spawn(move || {
            let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
            runtime.block_on(async move {
                let simulated = Shared::new(SimulatedRig::new(&drawn, 1).expect("a simulated rig"));
                // The longest lease: a busy machine must not end a move.
                let board = Board::in_process(simulated, drawn, SessionId(7), 1000).await.expect("a board");
                let mut board = shown.watching(board);
                tokio::select! {
                    error = driver.drive(&mut board, None) => panic!("the link ended: {error}"),
                    _ = ended => {}
                }
            });
        });
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let serving = panel.serve(listener, access.clone()).expect("a server");
        Self { panel, rig, address: serving.address(), access, _serving: serving, _end: end }
    }

    /// A page that was loaded from the panel.
    pub async fn page(&self) -> Page {
        let query = match &self.access {
            Access::Token(token) => format!("?token={token}"),
            Access::ThisComputer => String::new(),
        };
        Page::open(self.address, &query).await
    }
}

pub type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Opens the socket of the panel as a page of `origin` does.
pub async fn open(address: SocketAddr, query: &str, origin: Option<&str>) -> Result<Socket, Box<Error>> {
    let mut request = format!("ws://{address}/socket{query}").into_client_request().expect("a request");
    if let Some(origin) = origin {
        request.headers_mut().insert("origin", HeaderValue::from_str(origin).expect("a header"));
    }
    Ok(connect_async(request).await.map_err(Box::new)?.0)
}

/// An open page.
pub struct Page {
    pub socket: Socket,
    pub id: u64,
    /// The latest message of each kind.
    pub latest: BTreeMap<String, Value>,
}

impl Page {
    /// A page that was loaded from the panel at this address.
    pub async fn open(address: SocketAddr, query: &str) -> Self {
        let origin = format!("http://{address}");
        let socket = open(address, query, Some(&origin)).await.expect("the page is let in");
        let mut page = Self { socket, id: 0, latest: BTreeMap::new() };
        page.id = page.next("hello").await["you"].as_u64().expect("a number");
        page
    }

    pub async fn send(&mut self, message: Value) {
        self.socket.send(Message::Text(message.to_string().into())).await.expect("the panel listens");
    }

    /// Reads one message; the header of one that is not only text.
    pub async fn read(&mut self) -> Value {
        loop {
            let message = timeout(PATIENCE, self.socket.next()).await.expect("a message in time");
            let header = match message.expect("an open socket").expect("a message") {
                Message::Text(text) => serde_json::from_str::<Value>(&text).expect("JSON"),
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
                    let mut header: Value = serde_json::from_slice(&bytes[4..4 + length]).expect("JSON");
                    header["payload_bytes"] = json!(bytes.len() - 4 - length);
                    header
                }
                _ => continue,
            };
            self.latest.insert(header["kind"].as_str().expect("a kind").to_owned(), header.clone());
            return header;
        }
    }

    /// Reads until a message of this kind.
    pub async fn next(&mut self, kind: &str) -> Value {
        self.until(|message| message["kind"] == kind).await
    }

    /// Reads until a message is as wanted, and says meanwhile that this page is there.
    pub async fn until(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        let found = timeout(PATIENCE, async {
            let mut count = 0_u32;
            loop {
                let message = self.read().await;
                if wanted(&message) {
                    return message;
                }
                count += 1;
                if count.is_multiple_of(5) {
                    self.send(json!({ "do": "beat" })).await;
                }
            }
        });
        match found.await {
            Ok(found) => found,
            Err(_) => panic!("it never came; the latest messages are {:#?}", self.latest),
        }
    }

    /// Takes control, which nobody else may have.
    pub async fn take(&mut self) {
        self.send(json!({ "do": "take" })).await;
        let id = self.id;
        self.until(|message| message["kind"] == "control" && message["driver"] == id).await;
    }

    /// Waits until the board says so.
    pub async fn status(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        self.until(|message| message["kind"] == "status" && wanted(message)).await
    }
}

/// Shows the panel a cloud of one point, numbered `number`.
pub fn show_cloud(panel: &Panel, rig: &Rig, number: u64) {
    let pixel = |u| Pixel { u, v: 500.0 };
    let point = CloudPoint {
        pair_index: 0,
        pixels: PixelPair { left: pixel(600.0), right: pixel(500.0) },
        point: Point::from_mm(nalgebra::Vector3::new(10.0, 20.0, 600.0)),
        sigma_range: Length::from_mm(1.5),
        covariance: Matrix3::identity(),
        own_covariance: Matrix3::identity(),
        residual: Angle::from_rad(2e-4),
        residual_sigma: Angle::from_rad(1e-4),
        extrapolated: false,
    };
    let coloured = ColouredPoint { point, colour: [1, 2, 3], score: 0.9, track: None };
    let cloud = Box::new(PairCloud { points: vec![coloured], matches: 1, ..PairCloud::default() });
    let pose = Box::new(rig.pose_read_at(&[145.0, 0.0]));
    let observation = Observation::Points { cloud, pose, moving: false, by_images: Vec::new() };
    let middle = BoardInstant { us: 0.0, error_us: 0.0 };
    let measurement = Measurement { observation, middle, unseen: None, dense: None, decode_seconds: 0.0, seconds: 0.1 };
    let totals = Totals { clouds: number, ..Totals::default() };
    panel.show(&LiveResult {
        measurement: &measurement,
        latency: Duration::from_millis(5),
        totals: &totals,
        limited: None,
        pace: None,
    });
}
