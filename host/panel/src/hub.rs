//! What rig, server and pages share: the latest of every stream, who drives, the log, and the ways by which orders reach the rig.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use image::RgbImage;
use serde_json::{Value, json};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::{Semaphore, mpsc, oneshot, watch};
use vergence_board::HostClock;
use vergence_live::{Notice, Rung, Step};
use vergence_rig::{AxisPosition, Rig};

use crate::log::{Level, Log};
use crate::message::{Order, PageMessage};
use crate::operators::{ClientId, Control, Operators};
use crate::streams::{Outgoing, Seen, Stream, Streams};

/// Orders that may wait for the rig; who gives more is told to wait.
pub const ORDERS_KEPT: usize = 4;
/// The most pages at a time.
const MOST_PAGES: usize = 32;

/// What is shown.
#[derive(Clone, Debug)]
pub struct Setting {
    /// The rig that measures.
    pub rig: Arc<Rig>,
    /// What is simulated, in words; `None` for a real rig.
    pub simulated: Option<String>,
    /// Whether cameras deliver images.
    pub has_cameras: bool,
    /// When a recording was begun that is shown in the place of a rig, in milliseconds since 1970; `None` of a rig that is there.
    pub recorded_ms: Option<u64>,
}

/// How a recording shall be played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// Whether it is held.
    pub is_paused: bool,
    /// Counts the jumps.
    pub jumps: u64,
    /// Where the last jump led, so long after the first event.
    pub jump_to: Duration,
}

/// An order, and how often the rig had been halted when it was given: a stop takes back what waits.
pub struct Given {
    pub order: Order,
    pub halts: u64,
    /// Who wants to know what becomes of it.
    pub told: Option<Told>,
}

/// Where the outcome of an order goes: a sentence, of success or of what ended it.
pub type Told = oneshot::Sender<Result<String, String>>;

/// Where the rig is being sent.
#[derive(Clone, Debug, Default)]
pub struct Task {
    pub text: Option<String>,
    pub targets: Option<Vec<AxisPosition>>,
}

/// The images of the measured pair, left and right, as far as there are any.
pub type Images = [Option<Arc<RgbImage>>; 2];

pub struct Hub {
    pub setting: Setting,
    /// Since when the panel is there.
    pub clock: HostClock,
    shared: Mutex<Shared>,
    /// Grows with every change that a page should see.
    changes: watch::Sender<u64>,
    /// Counts the stops.
    pub halts: watch::Sender<u64>,
    /// Whether all axes have had their reference.
    pub referenced: watch::Sender<bool>,
    /// Positions of the axes in millimetres or radians, as they were told last.
    pub place: watch::Sender<Option<Vec<f64>>>,
    /// The images that were measured last.
    pub images: watch::Sender<Images>,
    /// Number of open pages: what none would see is not computed.
    pub pages: watch::Sender<usize>,
    /// How the pages want a recording to be played.
    pub wish: watch::Sender<Wish>,
    /// Lets one search for a pose run at a time.
    pub planning: Arc<Semaphore>,
    orders: mpsc::Sender<Given>,
}

#[derive(Default)]
struct Shared {
    streams: Streams,
    operators: Operators,
    log: Log,
    task: Task,
    /// What the live loop does without, and what it said of it.
    without: BTreeMap<Rung, String>,
}

impl Hub {
    /// A hub, and where its orders arrive.
    pub fn new(setting: Setting) -> (Self, mpsc::Receiver<Given>) {
        let (orders, given) = mpsc::channel(ORDERS_KEPT);
        // A rig without axes has none to look for.
        let referenced = setting.rig.axes.is_empty();
        let place = referenced.then(Vec::new);
        let hub = Self {
            setting,
            clock: HostClock::start(),
            shared: Mutex::default(),
            changes: watch::Sender::new(0),
            halts: watch::Sender::new(0),
            referenced: watch::Sender::new(referenced),
            place: watch::Sender::new(place),
            images: watch::Sender::new([None, None]),
            pages: watch::Sender::new(0),
            wish: watch::Sender::new(Wish::default()),
            planning: Arc::new(Semaphore::new(1)),
            orders,
        };
        (hub, given)
    }

    /// A poisoned lock only means that another thread panicked; nothing here is left half written.
    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.clock.now().0)
    }

    fn wake(&self) {
        self.changes.send_modify(|count| *count += 1);
    }

    /// Tells when there is something new.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Replaces the latest message of a stream.
    pub fn put(&self, stream: Stream, message: Outgoing) {
        self.lock().streams.put(stream, message);
        self.wake();
    }

    /// The next message for a page that has seen others.
    pub fn next(&self, seen: &mut Seen) -> Option<Outgoing> {
        self.lock().streams.next(seen)
    }

    /// The latest message of a stream.
    pub fn latest(&self, stream: Stream) -> Option<Outgoing> {
        self.lock().streams.latest(stream).cloned()
    }

    /// Adds a line of the panel to the log.
    pub fn note(&self, level: Level, text: &str) {
        self.note_at("panel", self.now().as_secs_f64(), level, text);
    }

    /// Adds a line from `source` with the time of its clock.
    pub fn note_at(&self, source: &str, seconds: f64, level: Level, text: &str) {
        let mut shared = self.lock();
        shared.log.add(source, seconds, level, text);
        let message = text_message(&shared.log.json());
        shared.streams.put(Stream::Log, message);
        drop(shared);
        self.wake();
    }

    /// Shows what the live loop does without, of which it told.
    pub fn take_step(&self, Notice { text, step }: &Notice) {
        let Some(Step { rung, is_down }) = *step else { return };
        let mut shared = self.lock();
        if is_down {
            shared.without.insert(rung, text.clone());
        } else {
            shared.without.remove(&rung);
        }
        let rungs = shared.without.iter().map(|(rung, text)| json!({ "rung": rung.as_str(), "text": text }));
        let message = text_message(&json!({ "kind": "ladder", "without": rungs.collect::<Vec<_>>() }));
        shared.streams.put(Stream::Ladder, message);
        drop(shared);
        self.wake();
    }

    /// What the rig is doing.
    pub fn task(&self) -> Task {
        self.lock().task.clone()
    }

    pub fn set_task(&self, task: Task) {
        self.lock().task = task;
    }

    /// A page connected; `None` where too many are.
    pub fn join(&self) -> Option<ClientId> {
        let mut shared = self.lock();
        if shared.operators.count() >= MOST_PAGES {
            return None;
        }
        let client = shared.operators.join(self.now());
        self.pages.send_replace(shared.operators.count());
        publish_control(&mut shared);
        drop(shared);
        self.wake();
        Some(client)
    }

    /// A page is gone; the rig stops where it drove.
    pub fn leave(&self, client: ClientId) {
        let mut shared = self.lock();
        let drove = shared.operators.leave(client);
        self.pages.send_replace(shared.operators.count());
        publish_control(&mut shared);
        drop(shared);
        self.wake();
        if drove {
            self.halt(&format!("page {} drove and is gone", client.0));
        }
    }

    /// Takes control from a page that drives and is silent; the rig stops.
    pub fn drop_silent(&self) {
        let mut shared = self.lock();
        if !shared.operators.drop_silent(self.now()) {
            return;
        }
        publish_control(&mut shared);
        drop(shared);
        self.wake();
        self.halt("the page that drove is silent");
    }

    /// Stops what moves, and takes back what waits.
    pub fn halt(&self, why: &str) {
        self.halts.send_modify(|count| *count += 1);
        self.note(Level::Note, &format!("stop: {why}"));
    }

    /// Does what a page asks; a refusal is a sentence for that page. A search for a pose is not done here.
    pub fn take(&self, client: ClientId, message: PageMessage) -> Result<(), String> {
        let rig = &self.setting.rig;
        let mut shared = self.lock();
        shared.operators.beat(client, self.now());
        let order = match message {
            PageMessage::Beat | PageMessage::Plan(_) => return Ok(()),
            PageMessage::Pause | PageMessage::Resume | PageMessage::Jump { .. } => return self.play(&message),
            _ if self.setting.recorded_ms.is_some() => {
                return Err("this is a recording: there is no rig that could be driven".to_owned());
            }
            PageMessage::Stop => {
                drop(shared);
                self.halt(&format!("asked by page {}", client.0));
                return Ok(());
            }
            PageMessage::Take => {
                drop(shared);
                self.take_control(client);
                return Ok(());
            }
            PageMessage::HandOver => {
                if !shared.operators.hand_over(client) {
                    return Err("this page does not drive".to_owned());
                }
                publish_control(&mut shared);
                drop(shared);
                self.note(Level::Note, &format!("page {} handed control over", client.0));
                return Ok(());
            }
            _ if shared.operators.driver() != Some(client) => {
                return Err("this page watches: take control first".to_owned());
            }
            PageMessage::Home => Order::Home,
            PageMessage::Clear => Order::Clear,
            PageMessage::Mode { name } => Order::mode(rig, &name)?,
            PageMessage::Move { to } => Order::go(rig, &to)?,
        };
        drop(shared);
        self.order(order)
    }

    /// Plays a recording as a page wants it.
    fn play(&self, message: &PageMessage) -> Result<(), String> {
        if self.setting.recorded_ms.is_none() {
            return Err("this is no recording: it cannot be held".to_owned());
        }
        match message {
            PageMessage::Jump { to_s } => {
                let jump_to = Duration::try_from_secs_f64(*to_s).map_err(|_| format!("{to_s} s is no time"))?;
                self.wish.send_modify(|wish| *wish = Wish { jumps: wish.jumps + 1, jump_to, ..*wish });
            }
            _ => self.wish.send_modify(|wish| wish.is_paused = *message == PageMessage::Pause),
        }
        Ok(())
    }

    /// A page wants to drive.
    pub fn take_control(&self, client: ClientId) -> Control {
        let mut shared = self.lock();
        let control = shared.operators.take(client);
        publish_control(&mut shared);
        drop(shared);
        let said = if control == Control::Given { "drives" } else { "asks for control" };
        self.note(Level::Note, &format!("page {} {said}", client.0));
        control
    }

    /// Gives an order to the rig.
    ///
    /// # Errors
    /// A sentence where too many wait, and where nothing carries orders out.
    pub fn order(&self, order: Order) -> Result<(), String> {
        self.give(order, None)
    }

    /// As [`Hub::order`], for one who wants to know what becomes of it.
    pub fn order_told(&self, order: Order) -> Result<oneshot::Receiver<Result<String, String>>, String> {
        let (told, outcome) = oneshot::channel();
        self.give(order, Some(told))?;
        Ok(outcome)
    }

    fn give(&self, order: Order, told: Option<Told>) -> Result<(), String> {
        let given = Given { order, halts: *self.halts.borrow(), told };
        self.orders.try_send(given).map_err(|refused| match refused {
            TrySendError::Full(_) => "the rig is busy with earlier orders: stop it, or wait".to_owned(),
            TrySendError::Closed(_) => "nothing here drives a rig".to_owned(),
        })
    }

    /// The first message to a page: its number, and what does not change.
    pub fn hello(&self, client: ClientId) -> Outgoing {
        let rig = &self.setting.rig;
        let axes = rig.axes.iter().map(|axis| {
            let unit = if axis.kind == vergence_protocol::AxisKind::Linear { "mm" } else { "deg" };
            let [least, most] = axis.range.map(AxisPosition::mm_or_deg);
            json!({ "name": axis.name, "unit": unit, "least": least, "most": most })
        });
        let modes = rig.modes.iter().map(|mode| {
            let targets = mode.targets.iter().map(|target| target.mm_or_deg());
            json!({ "name": mode.name, "targets": targets.collect::<Vec<_>>() })
        });
        let sizes = [rig.left_camera.size(), rig.right_camera.size()].map(|size| [size.width, size.height]);
        text_message(&json!({
            "kind": "hello",
            "you": client.0,
            "version": env!("CARGO_PKG_VERSION"),
            "rig": rig.name,
            "simulated": self.setting.simulated,
            "has_cameras": self.setting.has_cameras,
            "recorded_ms": self.setting.recorded_ms,
            "has_trunk": rig.trunk.is_some(),
            "axes": axes.collect::<Vec<_>>(),
            "modes": modes.collect::<Vec<_>>(),
            "image_sizes": sizes,
        }))
    }
}

/// A message of JSON.
pub fn text_message(json: &Value) -> Outgoing {
    Outgoing::Text(json.to_string().into())
}

fn publish_control(shared: &mut Shared) {
    let operators = &shared.operators;
    let asking: Vec<_> = operators.asking().iter().map(|client| client.0).collect();
    let message = text_message(&json!({
        "kind": "control",
        "driver": operators.driver().map(|client| client.0),
        "asking": asking,
        "pages": operators.count(),
    }));
    shared.streams.put(Stream::Control, message);
}
