//! An operator on another machine: it drives as a page does, one at a time, and the rig stops when it is silent.

use std::sync::Arc;

use tokio::sync::oneshot::Receiver;

use crate::hub::Hub;
use crate::message::{Order, PageMessage};
use crate::operators::{ClientId, Control};

/// Lets operators on other machines drive the rig of a panel. A clone is the same.
#[derive(Clone)]
pub struct Remotes(pub(crate) Arc<Hub>);

/// One of them. Dropping it gives control back; the rig stops where it moved.
pub struct Remote {
    hub: Arc<Hub>,
    client: ClientId,
}

impl Remotes {
    /// Sends the rig to a mode in the name of an operator who says so several times a second ([`Remote::beat`]): one who is silent for longer than
    /// [`LATEST_BEAT`](crate::LATEST_BEAT) loses control, and the rig stops. What became of the order arrives at the receiver: a sentence, of success
    /// or of what ended it.
    ///
    /// # Errors
    /// A sentence where somebody else drives, where there is no such mode, and where the rig takes no orders.
    pub fn mode(&self, name: &str) -> Result<(Remote, Receiver<Result<String, String>>), String> {
        let order = Order::mode(&self.0.setting.rig, name)?;
        let client = self.0.join().ok_or("too many pages and operators are connected")?;
        let remote = Remote { hub: Arc::clone(&self.0), client };
        if self.0.take_control(client) == Control::Asked {
            // It does not wait for control: who gave the order may not want it any more when it comes.
            return Err("somebody else drives this rig: they must hand over first".to_owned());
        }
        match self.0.order_told(order) {
            Ok(outcome) => Ok((remote, outcome)),
            Err(why) => {
                // What moves is not of this operator, and goes on.
                remote.finish();
                Err(why)
            }
        }
    }
}

impl Remote {
    /// The operator is there.
    pub fn beat(&self) {
        // A heartbeat is never refused.
        let _ = self.hub.take(self.client, PageMessage::Beat);
    }

    /// The order is carried out: control goes to who asked for it, and nothing has to stop.
    pub fn finish(self) {
        let _ = self.hub.take(self.client, PageMessage::HandOver);
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        self.hub.leave(self.client);
    }
}
