//! The bodies of the targets. Each takes any bytes; it must neither panic nor go on for ever.

use serde::ser::{Serialize, SerializeTuple, Serializer};
use vergence_control::{BoardSettings, Delivered, settings_store};
use vergence_plant::{NATIVE_HARDWARE, NativeBoard, RamFlash, bench_mechanics, bench_settings};
use vergence_protocol::frame::{Header, Kind, MAX_BODY, checksum, encode};
use vergence_protocol::management::{CHUNK, ImageHeader, Management, ManagementReport, Signature};
use vergence_protocol::update::Upload;
use vergence_protocol::{
    AxisMask, HostEvent, HostSession, MAX_FRAME, Microseconds, PROTOCOL, Receiver, Report, Request, SessionId,
    StopKind, schema_hash,
};

/// More frames than either end can owe at any time.
const MOST_OWED: usize = 40;

/// Reads the input as a script; past its end there are zeros.
struct Script<'a>(&'a [u8]);

impl<'a> Script<'a> {
    fn byte(&mut self) -> u8 {
        let Some((&byte, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        byte
    }

    /// Up to `most` bytes.
    fn bytes(&mut self, most: usize) -> &'a [u8] {
        let length = usize::from(self.byte()).min(most).min(self.0.len());
        let (bytes, rest) = self.0.split_at(length);
        self.0 = rest;
        bytes
    }

    /// The message that the next bytes are, where they are one.
    fn message<M: serde::Deserialize<'a>>(&mut self) -> Option<M> {
        let (message, rest) = postcard::take_from_bytes(self.0).ok()?;
        self.0 = rest;
        Some(message)
    }

    fn is_over(&self) -> bool {
        self.0.is_empty()
    }
}

/// Bytes that are a body as they are.
struct Raw<'a>(&'a [u8]);

impl Serialize for Raw<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}

/// A frame whose checksum holds.
fn framed(kind: Kind, seq: u8, ack: u8, major: u8, body: &impl Serialize) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let length = encode(Header { major, kind, seq, ack }, body, &mut buffer).unwrap_or(0);
    buffer[..length].to_vec()
}

fn kind(byte: u8) -> Kind {
    [Kind::Control, Kind::Telemetry, Kind::Log, Kind::Firmware, Kind::Immediate, Kind::AckOnly, Kind::Nak]
        [usize::from(byte % 7)]
}

/// A frame with anything in it.
fn any_frame(script: &mut Script<'_>) -> Vec<u8> {
    let (kind, seq, ack) = (kind(script.byte()), script.byte(), script.byte());
    let major = if script.byte() < 200 { PROTOCOL.major } else { script.byte() };
    framed(kind, seq, ack, major, &Raw(script.bytes(MAX_BODY)))
}

/// Bytes to frames to messages; what is a message says the same when it is written and read again.
pub fn frame(data: &[u8]) {
    let mut receiver = Receiver::new();
    let mut messages = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let stuffed = framed(kind(data.len() as u8), 1, 2, PROTOCOL.major, &Raw(&data[..data.len().min(MAX_BODY)]));
    for &byte in data.iter().chain(&[0]).chain(&stuffed) {
        if let Some(frame) = receiver.push(byte) {
            messages.0.extend(frame.body::<Request>());
            messages.1.extend(frame.body::<Report>());
            messages.2.extend(frame.body::<Management>());
            messages.3.extend(frame.body::<ManagementReport>());
        }
    }
    messages.0.iter().for_each(same_again);
    messages.1.iter().for_each(same_again);
    messages.2.iter().for_each(same_again);
    messages.3.iter().for_each(same_again);
}

fn same_again<M: Serialize + serde::de::DeserializeOwned + PartialEq>(message: &M) {
    let frame = framed(Kind::Control, 0, 0, PROTOCOL.major, message);
    let mut receiver = Receiver::new();
    let read = frame.iter().filter_map(|&byte| receiver.push(byte).map(|frame| frame.body::<M>())).next();
    assert!(read.is_some_and(|read| read.as_ref() == Ok(message)));
}

/// The host's end against a board that says anything at any time.
pub fn host_session(data: &[u8]) {
    let mut script = Script(data);
    let mut host = HostSession::new(SessionId(1));
    let mut now = 0;
    host.hello();
    while !script.is_over() {
        let bytes = match script.byte() % 8 {
            0 => script.bytes(255).to_vec(),
            1 => {
                let hello = Report::Hello {
                    protocol: PROTOCOL,
                    schema: schema_hash() ^ u64::from(script.byte() & 1),
                    session: SessionId(1 + u32::from(script.byte() % 8 == 7)),
                    boot: u32::from(script.byte() % 8 == 7),
                };
                framed(Kind::Immediate, script.byte(), 0, PROTOCOL.major, &hello)
            }
            2 => {
                let _ = host.submit(Microseconds(now), Request::GetAxis { axis: script.byte() });
                Vec::new()
            }
            3 => {
                let _ = host.send_now(Request::Stop { kind: StopKind::Decelerate });
                Vec::new()
            }
            4 => {
                let _ = host.manage(Management::Identify);
                Vec::new()
            }
            5 => {
                now += u64::from(script.byte()) << (script.byte() % 32);
                Vec::new()
            }
            _ => any_frame(&mut script),
        };
        let mut heard = 0;
        host.receive(Microseconds(now), &bytes, |_| heard += 1);
        assert!(heard <= bytes.len());
        drain(|buffer| host.transmit(Microseconds(now), buffer));
    }
    let _ = (host.next_wake(), host.statistics(), host.unanswered());
}

fn drain(mut transmit: impl FnMut(&mut [u8; MAX_FRAME]) -> Option<usize>) {
    let mut buffer = [0; MAX_FRAME];
    let mut frames = 0;
    while let Some(length) = transmit(&mut buffer) {
        assert!(length <= MAX_FRAME);
        frames += 1;
        assert!(frames <= MOST_OWED, "it sends without end");
    }
}

/// The board's session and every handler behind it: what a host, or noise, may send in any order.
pub fn board_node(data: &[u8]) {
    let mut script = Script(data);
    let Ok(mut board) = NativeBoard::new(&bench_settings(), &bench_mechanics(), data.len() as u64) else { return };
    board.services_mut().image = RamFlash::new(2);
    board.services_mut().verifier = |_, _, signature| signature.r[0] == 1;
    let mut host = BoardUser { board, open: 0, seq: 0 };
    if script.byte() < 200 {
        host.hello(1, schema_hash());
    }
    while !script.is_over() {
        match script.byte() % 16 {
            0 => host.board.receive(script.bytes(255)),
            1 => host.board.receive(&any_frame(&mut script)),
            2 => host.hello(script.byte() % 4, schema_hash() ^ u64::from(script.byte() % 16 == 15)),
            3 => host.board.log(script.bytes(255)),
            4 => {
                let body = script.bytes(MAX_BODY);
                host.ask(&Raw(body));
            }
            5 => host.manage(&Management::Begin(ImageHeader {
                hardware: NATIVE_HARDWARE,
                length: u32::from(script.byte()) << (script.byte() % 6),
                ..ImageHeader::default()
            })),
            6 | 7 => {
                if let Some(request) = script.message::<Management>() {
                    host.manage(&request);
                }
            }
            8 | 9 => {
                let to = host.board.now().0 + (u64::from(script.byte()) << (script.byte() % 12));
                host.board.advance(Microseconds(to));
            }
            10 => host.beat(),
            11 => host.ask(&Request::Arm { session: SessionId(host.open) }),
            12 => {
                host.beat();
                host.ask(&Request::Arm { session: SessionId(host.open) });
                host.ask(&Request::Home { axes: AxisMask(script.byte()) });
            }
            _ => {
                if let Some(request) = script.message::<Request>() {
                    host.ask(&request);
                }
            }
        }
        check_frames(&host.board.transmit());
    }
    let _ = host.board.take_reboot();
}

/// A host of sorts: it keeps count, so that the board hears it.
struct BoardUser {
    board: NativeBoard,
    open: u32,
    seq: u8,
}

impl BoardUser {
    fn hello(&mut self, session: u8, schema: u64) {
        let session = u32::from(session);
        if session != self.open && session != 0 {
            (self.open, self.seq) = (session, 0);
        }
        let hello = Request::Hello { protocol: PROTOCOL, schema, session: SessionId(session) };
        self.board.receive(&framed(Kind::Immediate, 0, 0, PROTOCOL.major, &hello));
    }

    fn beat(&mut self) {
        let beat = Request::Heartbeat { session: SessionId(self.open), lease_ms: 1_000 };
        self.board.receive(&framed(Kind::Immediate, 0, 0, PROTOCOL.major, &beat));
    }

    fn ask(&mut self, request: &impl Serialize) {
        self.board.receive(&framed(Kind::Control, self.seq, 0, PROTOCOL.major, request));
        self.seq = self.seq.wrapping_add(1);
    }

    fn manage(&mut self, request: &Management) {
        self.board.receive(&framed(Kind::Firmware, 0, 0, PROTOCOL.major, request));
    }
}

/// What a board sends is whole and has an end.
fn check_frames(bytes: &[u8]) {
    let mut receiver = Receiver::new();
    let frames = bytes.iter().filter(|&&byte| receiver.push(byte).is_some()).count();
    assert!(frames <= MOST_OWED, "it sends without end");
    assert_eq!(receiver.counters().dropped(), 0);
}

/// Settings from flash that holds anything, whose checksum may hold all the same.
pub fn settings_store(data: &[u8]) {
    let Ok(defaults) = BoardSettings::new(&bench_settings()) else { return };
    let (&how, body) = data.split_first().unwrap_or((&0, &[]));
    let mut flash = RamFlash::new(2);
    if how < 64 {
        flash.overwrite(0, body);
    } else {
        let body = &body[..body.len().min(2_000)];
        let mut record = [b"VGS1", &u32::from(how).to_le_bytes(), &(body.len() as u32).to_le_bytes(), body].concat();
        record.extend(checksum(&record).to_le_bytes());
        flash.overwrite(0, &record);
    }
    if let Ok(Some(settings)) = settings_store::load(&mut flash, &Delivered::for_bench(defaults.clone())) {
        assert!(settings.validate().is_ok());
        assert!(settings_store::save(&mut flash, &settings).is_ok());
        assert_eq!(settings_store::load(&mut flash, &Delivered::for_bench(defaults)), Ok(Some(settings)));
    }
}

/// An update against a board that answers anything: it never sends what is not of the image, nor without end.
pub fn management(data: &[u8]) {
    let mut script = Script(data);
    let image: Vec<u8> = (0..4_000_u32).map(|number| number.to_le_bytes()[0]).collect();
    let header = ImageHeader { length: image.len() as u32, ..ImageHeader::default() };
    let Some(mut upload) = Upload::new(&image, header, Signature { r: [0; 32], s: [0; 32] }) else { return };
    let mut host = HostSession::new(SessionId(1));
    let (mut now, mut receiver, mut to) = (0, Receiver::new(), 0);
    while !script.is_over() {
        upload.transmit(Microseconds(now), &mut host);
        drain(|buffer| {
            let length = host.transmit(Microseconds(now), buffer)?;
            for &byte in buffer[..length].iter() {
                let Some(frame) = receiver.push(byte) else { continue };
                to = frame.header.seq;
                if let Ok(Management::Chunk { offset, data }) = frame.body() {
                    let rest = &image[offset as usize..];
                    assert!(data.len() <= CHUNK && data.len().is_multiple_of(8));
                    assert!(data.iter().zip(rest).all(|(sent, byte)| sent == byte));
                }
            }
            Some(length)
        });
        now += u64::from(script.byte()) << (script.byte() % 24);
        let outcome = script.byte();
        let body = [1, if outcome < 128 { to } else { script.byte() }];
        let next = (u32::from(script.byte()) << (script.byte() % 28)).to_le_bytes();
        let mut answer = body.to_vec();
        answer.extend(varint(u32::from_le_bytes(next)));
        answer.push(if outcome % 4 > 0 { 0 } else { outcome / 4 % 12 });
        let answer = framed(Kind::Firmware, 0, 0, PROTOCOL.major, &Raw(&answer));
        host.receive(Microseconds(now), &answer, |event| {
            if let HostEvent::Management(report) = event {
                upload.receive(Microseconds(now), &report);
            }
        });
        let (stored, total) = upload.progress();
        assert!(stored <= total);
        let _ = upload.next_wake();
        if script.byte() == 255 {
            host = HostSession::new(SessionId(2));
            upload.resume();
        }
    }
}

/// As postcard writes numbers.
fn varint(mut number: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number > 127 {
        bytes.push(number as u8 & 127 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}
