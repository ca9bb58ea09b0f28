//! A native board, a host and a line that loses what it likes, for updates.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

use ed25519_dalek::{Signer, SigningKey, VerifyingKey};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};
use vergence_plant::{NATIVE_HARDWARE, NativeBoard, bench_mechanics, bench_settings};
use vergence_protocol::frame::{Header, encode};
use vergence_protocol::management::{ImageHeader, Management, ManagementReport, Outcome, Signature};
use vergence_protocol::update::{Upload, UploadState};
use vergence_protocol::{
    HostEvent, HostSession, MAX_FRAME, Microseconds, Receiver, Report, Request, ResetCause, SessionId, Status,
};

/// A key for tests, and nothing else.
pub const SEED: [u8; 32] = [7; 32];
pub const STEP_US: u64 = 500;

pub fn public_key() -> [u8; 32] {
    VerifyingKey::from(&SigningKey::from_bytes(&SEED)).to_bytes()
}

pub fn verify(key: &[u8; 32], signed: &[u8; ImageHeader::SIGNED], signature: &Signature) -> bool {
    let key = VerifyingKey::from_bytes(key).unwrap();
    let signature = ed25519_dalek::Signature::from_components(signature.r, signature.s);
    key.verify_strict(signed, &signature).is_ok()
}

/// An image with stretches of erased flash in it, its header and its signature.
pub fn image(length: usize, seed: u64) -> (Vec<u8>, ImageHeader, Signature) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut bytes: Vec<u8> = (0..length).map(|_| random.random()).collect();
    bytes.chunks_mut(500).step_by(7).for_each(|part| part.fill(0xFF));
    let header = ImageHeader {
        hardware: NATIVE_HARDWARE,
        version: [1, 2, 3],
        length: length as u32,
        build: seed,
        sha256: Sha256::digest(&bytes).into(),
    };
    let signature = sign(&header, &SEED);
    (bytes, header, signature)
}

pub fn sign(header: &ImageHeader, seed: &[u8; 32]) -> Signature {
    let signature = SigningKey::from_bytes(seed).sign(&header.signed_bytes());
    Signature { r: *signature.r_bytes(), s: *signature.s_bytes() }
}

pub struct Bench {
    pub board: NativeBoard,
    pub host: HostSession,
    pub now: u64,
    /// What the board's clock is behind the host's.
    pub behind: u64,
    /// Share of frames lost, in each direction.
    pub loss: f64,
    pub random: Pcg64Mcg,
    /// The protocol major of the host, where it is another than the board's.
    pub foreign: Option<u8>,
    pub answers: Vec<ManagementReport>,
    pub replies: Vec<Report>,
}

impl Bench {
    pub fn new(loss: f64, seed: u64) -> Self {
        let mut board = NativeBoard::new(&bench_settings(), &bench_mechanics(), seed).unwrap();
        board.services_mut().key = public_key();
        board.services_mut().verifier = verify;
        let mut bench = Self {
            board,
            host: HostSession::new(SessionId(1)),
            now: 0,
            behind: 0,
            loss,
            random: Pcg64Mcg::seed_from_u64(seed),
            foreign: None,
            answers: Vec::new(),
            replies: Vec::new(),
        };
        // Whatever the board does first.
        bench.wait(1_000_000);
        bench
    }

    pub fn wait(&mut self, us: u64) {
        let until = self.now + us;
        while self.now < until {
            self.step();
        }
    }

    pub fn step(&mut self) {
        self.now += STEP_US;
        self.board.advance(Microseconds(self.now - self.behind));
        let mut buffer = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(Microseconds(self.now), &mut buffer) {
            if !self.random.random_bool(self.loss) {
                let frame = foreign::<Management>(&buffer[..length], self.foreign);
                self.board.receive(&frame);
            }
        }
        for frame in self.board.transmit().split_inclusive(|&byte| byte == 0) {
            if self.random.random_bool(self.loss) {
                continue;
            }
            let frame = foreign::<ManagementReport>(frame, self.foreign);
            self.host.receive(Microseconds(self.now), &frame, |event| match event {
                HostEvent::Management(report) => self.answers.push(report),
                HostEvent::Reply { report, .. } => self.replies.push(report),
                _ => {}
            });
        }
    }

    /// Carries an update on until it ends or for `limit` microseconds.
    pub fn run(&mut self, upload: &mut Upload<'_>, limit: u64) -> UploadState {
        let until = self.now + limit;
        while self.now < until && !matches!(upload.state(), UploadState::Done | UploadState::Failed(_)) {
            upload.transmit(Microseconds(self.now), &mut self.host);
            self.step();
            for answer in std::mem::take(&mut self.answers) {
                upload.receive(Microseconds(self.now), &answer);
            }
        }
        upload.state()
    }

    /// Asks without losses and waits for the answer.
    pub fn manage(&mut self, request: Management) -> (u32, Outcome) {
        let loss = std::mem::take(&mut self.loss);
        self.answers.clear();
        self.host.manage(request).unwrap();
        self.wait(10_000);
        self.loss = loss;
        match self.answers.pop() {
            Some(ManagementReport::Progress { next, outcome, .. }) => (next, outcome),
            other => panic!("{other:?}"),
        }
    }

    pub fn ask(&mut self, request: Request) -> Status {
        self.host.submit(Microseconds(self.now), request).unwrap();
        self.wait(50_000);
        match self.replies.pop() {
            Some(Report::Ack { status, .. }) => status,
            other => panic!("{other:?}"),
        }
    }

    pub fn open(&mut self, session: u32) {
        self.host = HostSession::new(SessionId(session));
        self.host.hello();
        self.wait(200_000);
        assert!(self.host.is_open());
    }

    pub fn restart(&mut self) {
        self.board.restart(ResetCause::Software, self.now as u32).unwrap();
        self.behind = self.now;
        self.wait(1_000_000);
    }

    pub fn holds(&mut self, image: &[u8]) -> bool {
        self.board.services_mut().image.bytes().starts_with(image)
    }

    /// Erase and program operations on the image so far.
    pub fn written(&mut self) -> usize {
        self.board.services_mut().image.operations()
    }
}

/// The frame with another major in its header: from a host of another age, or as that one would receive it.
pub fn foreign<M: Serialize + DeserializeOwned>(frame: &[u8], major: Option<u8>) -> Vec<u8> {
    let Some(major) = major else { return frame.to_vec() };
    let (mut receiver, mut buffer) = (Receiver::new(), [0; MAX_FRAME]);
    let mut out = Vec::new();
    for &byte in frame {
        if let Some(frame) = receiver.push(byte) {
            let body: M = frame.body().unwrap();
            let length = encode(Header { major, ..frame.header }, &body, &mut buffer).unwrap();
            out.extend(&buffer[..length]);
        }
    }
    out
}
