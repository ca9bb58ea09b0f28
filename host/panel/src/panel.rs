//! The panel as the rig's side sees it.

use std::net::TcpListener;
use std::sync::Arc;

use tokio::sync::mpsc::{Receiver, channel};
use vergence_board::Board;
use vergence_camera::CameraEvent;
use vergence_live::{LiveResult, Notice};
use vergence_recording::Recording;
use vergence_rig::Rig;
use vergence_vision::Side;

use crate::cloud::cloud_message;
use crate::driver::Driver;
use crate::error::PanelError;
use crate::guard::Access;
use crate::hub::{Hub, Setting};
use crate::log::Level;
use crate::message::Order;
use crate::pictures::{Darkroom, tapped};
use crate::remote::Remotes;
use crate::server::{Serving, serve};
use crate::status::Reporter;
use crate::streams::Stream;

/// Camera events that may wait.
const EVENTS_KEPT: usize = 16;

type Listener = Arc<dyn Fn(&LiveResult<'_>) + Send + Sync>;

/// Shows a rig to pages. A clone shows the same.
#[derive(Clone)]
pub struct Panel {
    pub(crate) hub: Arc<Hub>,
    pub(crate) darkroom: Darkroom,
    /// Who hears of every result besides.
    beside: Option<Listener>,
}

impl Panel {
    /// A panel that nobody sees yet, and what carries its orders out.
    #[must_use]
    pub fn new(setting: Setting) -> (Self, Driver) {
        let (hub, orders) = Hub::new(setting);
        let hub = Arc::new(hub);
        (Self { hub: Arc::clone(&hub), darkroom: Darkroom::default(), beside: None }, Driver::new(hub, orders))
    }

    /// Serves pages that `listener` accepts, on a thread of its own, until the result is dropped.
    ///
    /// # Errors
    /// [`PanelError::Server`] where the thread does not start.
    pub fn serve(&self, listener: TcpListener, access: Access) -> Result<Serving, PanelError> {
        serve(Arc::clone(&self.hub), listener, access)
    }

    /// The board, whose poses the panel shows from now on.
    #[must_use]
    pub fn watching(&self, board: Board) -> Board {
        let mut reporter = Reporter::new(Arc::clone(&self.hub));
        let (knowledge, clock) = (board.client().knowledge(), board.client().clock());
        board.observed(move |rig, pose| reporter.report(rig, pose, &knowledge, clock.now()))
    }

    /// Passes camera events on and keeps each image that is developed for what comes after it. Images from before the axes have their
    /// reference are left out: nobody knows where they were taken. `recording` has the others first.
    #[must_use]
    pub fn tap(
        &self,
        mut events: Receiver<(Side, CameraEvent)>,
        recording: Option<&Recording>,
    ) -> Receiver<(Side, CameraEvent)> {
        let (sender, out) = channel(EVENTS_KEPT);
        let (darkroom, referenced) = (self.darkroom.clone(), self.hub.referenced.subscribe());
        let mut recorded = recording.map(Recording::cameras);
        tokio::spawn(async move {
            while let Some((side, event)) = events.recv().await {
                if matches!(event, CameraEvent::Image(_)) && !*referenced.borrow() {
                    continue;
                }
                let event = match &mut recorded {
                    Some(record) => record(side, event),
                    None => event,
                };
                if sender.send((side, tapped(event, side, &darkroom))).await.is_err() {
                    return;
                }
            }
        });
        out
    }

    /// The panel that tells `listener` of every result that it shows; that must be quick.
    #[must_use]
    pub fn beside(self, listener: impl Fn(&LiveResult<'_>) + Send + Sync + 'static) -> Self {
        Self { beside: Some(Arc::new(listener)), ..self }
    }

    /// The rig that is shown.
    #[must_use]
    pub fn rig(&self) -> &Arc<Rig> {
        &self.hub.setting.rig
    }

    /// What lets operators on other machines drive.
    #[must_use]
    pub fn remotes(&self) -> Remotes {
        Remotes(Arc::clone(&self.hub))
    }

    /// Shows a result of the live loop, with the images from which it was measured.
    pub fn show(&self, result: &LiveResult<'_>) {
        if let Some(listener) = &self.beside {
            listener(result);
        }
        self.hub.put(Stream::Cloud, cloud_message(result));
        self.hub.images.send_replace(self.darkroom.images());
    }

    /// Adds a line to the log.
    pub fn note(&self, text: &str) {
        self.hub.note(Level::Note, text);
    }

    /// Adds a warning to the log.
    pub fn warn(&self, text: &str) {
        self.hub.note(Level::Warning, text);
    }

    /// Adds what the live loop tells to the log, and shows what it does without.
    pub fn notice(&self, notice: &Notice) {
        self.hub.take_step(notice);
        self.warn(&notice.text);
    }

    /// Orders the axes to be homed, as a page would.
    pub fn home(&self) {
        if let Err(why) = self.hub.order(Order::Home) {
            self.warn(&why);
        }
    }
}
