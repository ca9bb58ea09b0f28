//! Reads a recording from its beginning to its end, or to where the program that wrote it died.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use std::time::Duration;

use image::{ImageFormat, RgbImage};
use mcap::MAGIC;
use mcap::records::{Record, op};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use vergence_rig::{HostInstant, Rig};

use crate::RecordingError;
use crate::bag::{EVENTS, FILE, LEFT_IMAGE, PROGRAM, RIG, RIGHT_IMAGE, SIMULATED};
use crate::cdr::{image_bytes, number_and_bytes};
use crate::event::{Event, Eye};

/// A recording that is being read.
pub struct Reader {
    file: PathBuf,
    bytes: BufReader<File>,
    records: LinearReader,
    /// Topics by the number of their channel.
    topics: BTreeMap<u16, String>,
    rig: Option<String>,
    simulated: Option<String>,
    images: [Option<Vec<u8>>; 2],
    /// Images that were heard before this time are not decoded, in microseconds of the host's clock.
    decode_from_us: u64,
    /// Nanoseconds since 1970 at which the first event was heard.
    begun_ns: Option<u64>,
    is_finished: bool,
}

/// An event of a recording with the time at which it was heard.
#[derive(Clone, Debug, PartialEq)]
pub struct Heard {
    /// The time on the host's clock in microseconds.
    pub host_us: u64,
    /// The time at which that clock started, in microseconds since 1970.
    pub epoch_us: u64,
    /// The event.
    pub event: Event,
    /// The image of [`Event::Image`], unless it is left out.
    pub image: Option<RgbImage>,
}

/// An instant of the host's clock, which started at `epoch_us`, in nanoseconds since 1970: the stamp of an image in messages and file names.
#[must_use]
pub fn stamp_ns(epoch_us: u64, at: HostInstant) -> u64 {
    (epoch_us * 1000).saturating_add((at.us.max(0.0) * 1000.0) as u64)
}

impl Reader {
    /// Opens the recording in `folder`, or the MCAP file of that name.
    ///
    /// # Errors
    /// [`RecordingError::Read`], [`RecordingError::NoMcap`]
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = if path.is_dir() { path.join(FILE) } else { path.to_owned() };
        let mut bytes = File::open(&file).map_err(|error| RecordingError::read(&file, error))?;
        let mut begins = vec![0; MAGIC.len()];
        if bytes.read_exact(&mut begins).is_err() || begins != MAGIC {
            return Err(RecordingError::NoMcap(file));
        }
        bytes.rewind().map_err(|error| RecordingError::read(&file, error))?;
        // The end is missing where the program that wrote it died.
        let options = LinearReaderOptions::default().with_skip_end_magic(true).with_validate_chunk_crcs(true);
        let records = LinearReader::new_with_options(options);
        let bytes = BufReader::new(bytes);
        Ok(Self {
            file,
            bytes,
            records,
            topics: BTreeMap::new(),
            rig: None,
            simulated: None,
            images: [None, None],
            decode_from_us: 0,
            begun_ns: None,
            is_finished: false,
        })
    }

    /// How long the recording is, from its first to its last message; `None` where its end is missing.
    #[must_use]
    pub fn length(&self) -> Option<Duration> {
        let mut file = File::open(&self.file).ok()?;
        let mut summary = SummaryReader::new();
        while let Some(event) = summary.next_event() {
            match event.ok()? {
                SummaryReadEvent::ReadRequest(count) => {
                    let read = file.read(summary.insert(count)).ok()?;
                    summary.notify_read(read);
                }
                SummaryReadEvent::SeekRequest(place) => summary.notify_seeked(file.seek(place).ok()?),
            }
        }
        let found = summary.finish()?.stats?;
        Some(Duration::from_nanos(found.message_end_time.saturating_sub(found.message_start_time)))
    }

    /// When the first event was heard, in nanoseconds since 1970; `None` before it was read.
    #[must_use]
    pub const fn begun_ns(&self) -> Option<u64> {
        self.begun_ns
    }

    /// Leaves images out that were heard before `host_us`: their events come without them.
    pub const fn decode_from(&mut self, host_us: u64) {
        self.decode_from_us = host_us;
    }

    /// The rig file that is attached; it precedes all events.
    #[must_use]
    pub fn rig(&self) -> Option<&str> {
        self.rig.as_deref()
    }

    /// The rig of the attached file; read the first event before.
    ///
    /// # Errors
    /// [`RecordingError::NoRig`], [`RecordingError::Foreign`] where nothing could be read, [`RecordingError::Rig`]
    pub fn attached_rig(&self) -> Result<Rig, RecordingError> {
        let text = self.rig().ok_or_else(|| match self.topics.is_empty() {
            true => self.foreign("its beginning"),
            false => RecordingError::NoRig(self.file.clone()),
        })?;
        Rig::from_toml(text).map_err(|error| RecordingError::Rig { file: self.file.clone(), why: error.to_string() })
    }

    /// What of the rig was simulated, in words; it precedes all events.
    #[must_use]
    pub fn simulated(&self) -> Option<&str> {
        self.simulated.as_deref()
    }

    /// Whether the end of the recording was read. That of a program that was killed has none: its last events are lost.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.is_finished
    }

    /// The file that is read.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The next event; `None` after the last.
    ///
    /// # Errors
    /// [`RecordingError::Read`], [`RecordingError::Foreign`]
    pub fn next_event(&mut self) -> Result<Option<Heard>, RecordingError> {
        loop {
            let Some((opcode, body)) = self.record()? else { return Ok(None) };
            if let Some(heard) = self.understand(opcode, &body)? {
                return Ok(Some(heard));
            }
        }
    }

    /// The next record of the file.
    fn record(&mut self) -> Result<Option<(u8, Vec<u8>)>, RecordingError> {
        let mut is_at_end = false;
        loop {
            match self.records.next_event() {
                None => return Ok(None),
                Some(Ok(LinearReadEvent::Record { opcode, data })) => return Ok(Some((opcode, data.to_vec()))),
                Some(Ok(LinearReadEvent::ReadRequest(_)) | Err(_)) if is_at_end => return Ok(None),
                Some(Ok(LinearReadEvent::ReadRequest(count))) => {
                    let room = self.records.insert(count);
                    let read = self.bytes.read(room).map_err(|error| RecordingError::read(&self.file, error))?;
                    self.records.notify_read(read);
                    is_at_end = read == 0;
                }
                Some(Err(error)) => return Err(RecordingError::read(&self.file, error)),
            }
        }
    }

    /// Keeps what a record says; returns its event, if it is one.
    fn understand(&mut self, opcode: u8, body: &[u8]) -> Result<Option<Heard>, RecordingError> {
        self.is_finished |= opcode == op::DATA_END;
        if !matches!(opcode, op::CHANNEL | op::MESSAGE | op::ATTACHMENT | op::METADATA) {
            return Ok(None);
        }
        match mcap::parse_record(opcode, body).map_err(|error| RecordingError::read(&self.file, error))? {
            Record::Channel(channel) => _ = self.topics.insert(channel.id, channel.topic),
            Record::Attachment { header, data, .. } if header.name == RIG => {
                let text = String::from_utf8(data.into_owned());
                self.rig = Some(text.map_err(|_| self.foreign("the attached rig file"))?);
            }
            Record::Metadata(mut found) if found.name == PROGRAM => self.simulated = found.metadata.remove(SIMULATED),
            Record::Message { header, data } => match self.topics.get(&header.channel_id).map(String::as_str) {
                Some(topic) if topic == EVENTS.name => {
                    self.begun_ns.get_or_insert(header.log_time);
                    return self.event(&data, header.log_time).map(Some);
                }
                Some(topic) if topic == LEFT_IMAGE.name => self.images[0] = Some(self.image(&data)?),
                Some(topic) if topic == RIGHT_IMAGE.name => self.images[1] = Some(self.image(&data)?),
                _ => {}
            },
            _ => {}
        }
        Ok(None)
    }

    fn image(&self, message: &[u8]) -> Result<Vec<u8>, RecordingError> {
        image_bytes(message).map(<[u8]>::to_vec).ok_or_else(|| self.foreign("an image"))
    }

    fn event(&mut self, message: &[u8], at_ns: u64) -> Result<Heard, RecordingError> {
        let (host_us, postcard) = number_and_bytes(message).ok_or_else(|| self.foreign("an event"))?;
        let event: Event = postcard::from_bytes(postcard).map_err(|_| self.foreign("an event"))?;
        let image = match event {
            Event::Image(eye, _) if host_us >= self.decode_from_us => Some(self.decoded(eye)?),
            _ => None,
        };
        Ok(Heard { host_us, epoch_us: (at_ns / 1000).saturating_sub(host_us), event, image })
    }

    /// The image that was written just before its event.
    fn decoded(&mut self, eye: Eye) -> Result<RgbImage, RecordingError> {
        let png = self.images[eye.side().index()].take().ok_or_else(|| self.foreign("an event without its image"))?;
        let image = image::load_from_memory_with_format(&png, ImageFormat::Png);
        Ok(image.map_err(|error| self.foreign(format!("an image ({error})")))?.into_rgb8())
    }

    fn foreign(&self, what: impl Into<String>) -> RecordingError {
        RecordingError::foreign(&self.file, what)
    }
}
