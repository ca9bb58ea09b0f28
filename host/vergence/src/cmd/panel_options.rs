//! The options of verbs that show on a page what they do.

use std::net::SocketAddr;

use serde_json::json;
use vergence_panel::{Panel, Serving, Setting, listen};

use crate::console::Console;
use crate::failure::Failure;

/// What is said where a page outlasts the work.
pub const GOES_ON: &str = "the page goes on showing this; Ctrl-C ends it";

/// Whether and where a page is served.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct PanelOptions {
    /// Serves a page that shows what is done and found, in any browser, until Ctrl-C.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8088")]
    pub panel: Option<SocketAddr>,
    /// Lets other computers see that page, such as the telephone of who stands beside the rig; they need the token in the address that is
    /// printed: --panel 0.0.0.0:8088 --network.
    #[arg(long, requires = "panel")]
    network: bool,
}

impl PanelOptions {
    /// Begins to serve a page of `setting` and says where, if one is wanted. It is served until the result is dropped.
    pub fn serve(self, setting: Setting, console: Console) -> Result<Option<(Panel, Serving)>, Failure> {
        let Some(address) = self.panel else { return Ok(None) };
        // Pages see and do not drive: there are no orders to be carried out.
        let (panel, _) = Panel::new(setting);
        let (listener, access) = listen(address, self.network)?;
        let serving = panel.serve(listener, access)?;
        console.say(format!("the panel is at {}", serving.url()))?;
        console.result(&json!({ "url": serving.url() }))?;
        Ok(Some((panel, serving)))
    }
}
