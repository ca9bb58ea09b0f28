//! Who answers at a port. The board is asked, and neither armed nor moved.

use std::time::Duration;

use serde_json::{Value, json};
use serialport::SerialPortInfo;
use tokio::task::JoinSet;
use tokio::time::timeout;
use vergence_protocol::management::{BootState, Identity};
use vergence_protocol::{BoardInfo, Report, Request};

use crate::firmware::hex;
use crate::link::{
    Client, Continuity, ManagementLink, OpenError, Port, describe_port, fresh_session, is_candidate, is_held,
    is_st_link, open, serial_ports,
};
use crate::update::{hardware_name, version_text};

/// Longest wait for an answer without a session: a board answers within milliseconds, and one question may be lost.
const IDENTIFY: Duration = Duration::from_millis(700);
/// Longest wait for a session and the board's description of itself.
const DESCRIBE: Duration = Duration::from_millis(1_500);

/// What was learnt of a port within about two seconds.
#[derive(Clone, Debug, PartialEq)]
pub enum WhoAnswers {
    /// A board with its application.
    Board(BoardInfo),
    /// A board that opens no session: its boot loader, or a firmware of another protocol.
    Unusual(Identity),
    /// Another vergence holds the port, so nothing was asked.
    Busy,
    /// Nothing that understands the question.
    Silent,
    /// The port cannot be opened; the operating system's reason.
    Closed(String),
    /// The simulated board `sim`, which exists only in the process of a verb.
    Simulated,
}

/// Asks who is at `port`, whose lines run at `baud` bits per second. A port that another vergence holds is left alone.
pub async fn who_answers(port: &Port, baud: u32) -> WhoAnswers {
    match port {
        Port::Simulated(_) => return WhoAnswers::Simulated,
        Port::Serial(path) if is_held(path) => return WhoAnswers::Busy,
        Port::Serial(_) | Port::Tcp(_) => {}
    }
    let identity = match timeout(DESCRIBE, ManagementLink::open(port.clone(), baud)).await {
        Ok(Ok(mut link)) => link.identify_within(IDENTIFY).await.ok(),
        Ok(Err(error)) => return closed(error),
        Err(_) => return WhoAnswers::Silent,
    };
    match (timeout(DESCRIBE, describe(port, baud)).await, identity) {
        (Ok(Some(info)), _) => WhoAnswers::Board(info),
        (_, Some(identity)) => WhoAnswers::Unusual(identity),
        (_, None) => WhoAnswers::Silent,
    }
}

fn closed(error: OpenError) -> WhoAnswers {
    match error {
        OpenError::InUse(_) => WhoAnswers::Busy,
        OpenError::Serial { problem, .. } | OpenError::Tcp { problem, .. } => WhoAnswers::Closed(problem),
        error => WhoAnswers::Closed(error.to_string()),
    }
}

/// The board's description of itself, through a session that is closed again.
async fn describe(port: &Port, baud: u32) -> Option<BoardInfo> {
    let wire = open(port, baud, false).await.ok()?;
    let continuity = Continuity::begin(wire.baud);
    let client = Client::at(port, wire, fresh_session().ok()?, continuity).await.ok()?;
    let answer = client.ask(Request::GetInfo).await;
    client.close().await;
    match answer.ok()? {
        Report::Info { info, .. } => Some(info),
        _ => None,
    }
}

impl WhoAnswers {
    /// For people, as the end of a line.
    #[must_use]
    pub fn in_words(&self) -> String {
        match self {
            Self::Board(info) => format!(
                "{} with firmware {}, {} axes, serial number {}",
                info.board,
                version_text(info.firmware),
                info.axes,
                hex(&info.uid)
            ),
            Self::Unusual(identity) if identity.boot == BootState::Recovery => {
                format!("{} in its boot loader: no application starts; see 'vergence flash'", hardware(identity))
            }
            Self::Unusual(identity) => format!(
                "{} with firmware {}, which opens no session with this vergence: see 'vergence flash'",
                hardware(identity),
                version_text(identity.version)
            ),
            Self::Busy => "in use by another vergence, so it was not asked".into(),
            Self::Silent => "nothing answers: no vergence board, no power, or another --baud".into(),
            Self::Closed(why) => format!("cannot be opened: {why}; see 'vergence doctor'"),
            Self::Simulated => "the simulated board of each verb".into(),
        }
    }

    /// For programs.
    #[must_use]
    pub fn json(&self) -> Value {
        match self {
            Self::Board(info) => json!({
                "answer": "board", "board": info.board.as_str(), "firmware": version_text(info.firmware),
                "build": format!("{:016x}", info.build), "axes": info.axes, "serial_number": hex(&info.uid),
            }),
            Self::Unusual(identity) => json!({
                "answer": if identity.boot == BootState::Recovery { "boot_loader" } else { "other_firmware" },
                "board": hardware(identity), "firmware": version_text(identity.version),
                "build": format!("{:016x}", identity.build),
            }),
            Self::Busy => json!({ "answer": "busy" }),
            Self::Silent => json!({ "answer": "none" }),
            Self::Closed(why) => json!({ "answer": "closed", "why": why }),
            Self::Simulated => json!({ "answer": "simulated" }),
        }
    }
}

fn hardware(identity: &Identity) -> String {
    hardware_name(identity.hardware)
}

/// A serial port of this machine, or one that was named.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedPort {
    /// Its name, as for `--port`.
    pub name: String,
    /// A few words on it.
    pub description: String,
    /// Whether it belongs to an ST-LINK, the debugger on a NUCLEO board.
    pub is_st_link: bool,
    /// Whether verbs try it where no port is named.
    pub is_candidate: bool,
    /// Who answers there; `None` where it was not asked.
    pub answer: Option<WhoAnswers>,
}

/// Every serial port of this machine, and the one called `named`. Where `asks`, those that may be a board and the named one are asked who they are, all at
/// the same time.
///
/// # Errors
/// The operating system's.
pub async fn list_ports(named: Option<&str>, baud: u32, asks: bool) -> Result<Vec<ListedPort>, OpenError> {
    let listed = |port: &SerialPortInfo| ListedPort {
        name: port.port_name.clone(),
        description: describe_port(port),
        is_st_link: is_st_link(port),
        is_candidate: is_candidate(port),
        answer: None,
    };
    let mut ports: Vec<_> = serial_ports()?.iter().map(listed).collect();
    if let Some(name) = named.filter(|name| ports.iter().all(|port| port.name != *name)) {
        let (is_st_link, is_candidate) = (false, true);
        ports.push(ListedPort {
            name: name.into(),
            description: "named".into(),
            is_st_link,
            is_candidate,
            answer: None,
        });
    }
    let mut asked = JoinSet::new();
    for (index, port) in ports.iter().enumerate() {
        let is_asked = asks && (port.is_candidate || named == Some(&port.name));
        if let Some(Ok(port)) = is_asked.then(|| port.name.parse::<Port>()) {
            asked.spawn(async move { (index, who_answers(&port, baud).await) });
        }
    }
    for (index, answer) in asked.join_all().await {
        ports.iter_mut().skip(index).take(1).for_each(|port| port.answer = Some(answer.clone()));
    }
    Ok(ports)
}

impl ListedPort {
    /// A line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let answer = match (&self.answer, self.is_candidate) {
            (Some(answer), _) => format!("; {}", answer.in_words()),
            (None, true) => String::new(),
            (None, false) => "; not tried unless named with --port".into(),
        };
        format!("{}  {}{answer}", self.name, self.description)
    }

    /// For programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "port": self.name, "description": self.description, "st_link": self.is_st_link, "candidate": self.is_candidate,
            "identity": self.answer.as_ref().map(WhoAnswers::json),
        })
    }
}
