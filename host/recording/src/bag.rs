//! A ROS 2 bag: a folder with one MCAP file and `metadata.yaml`.
//!
//! The file is a sequence of chunks with checksums; each goes to the disk whole as soon as it is full, so that a program that dies loses at
//! most the last one. `metadata.yaml` is written with the first chunk and once more at the end.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions, Writer};

use crate::RecordingError;
use crate::metadata::{TopicCount, metadata};

/// Bytes of messages in a chunk: about one large frame, or several small ones. A program that dies loses no more.
const CHUNK: u64 = 1 << 20;
/// The name of the MCAP file in the folder.
pub const FILE: &str = "recording_0.mcap";
/// The name of the rig file that is attached.
pub const RIG: &str = "rig.toml";

/// The name of the metadata that vergence writes, and its entry that says what was simulated.
pub const PROGRAM: &str = "vergence";
pub const SIMULATED: &str = "simulated";

/// A topic, and which messages it carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Topic {
    /// Its name.
    pub name: &'static str,
    /// The name of the message's type.
    pub kind: &'static str,
    /// The definition of that type, and of the types that it uses.
    pub definition: &'static str,
}

macro_rules! topics {
    ($($constant:ident $name:literal $kind:literal $file:literal)*) => {$(
        #[doc = concat!("`", $name, "`, a `", $kind, "`.")]
        pub const $constant: Topic =
            Topic { name: $name, kind: $kind, definition: include_str!(concat!("schemas/", $file, ".msg")) };
    )*};
}
topics! {
    EVENTS "/vergence/events" "vergence_msgs/msg/Event" "Event"
    LEFT_IMAGE "/left/image/compressed" "sensor_msgs/msg/CompressedImage" "CompressedImage"
    RIGHT_IMAGE "/right/image/compressed" "sensor_msgs/msg/CompressedImage" "CompressedImage"
    LEFT_INFO "/left/camera_info" "sensor_msgs/msg/CameraInfo" "CameraInfo"
    RIGHT_INFO "/right/camera_info" "sensor_msgs/msg/CameraInfo" "CameraInfo"
    JOINTS "/joint_states" "sensor_msgs/msg/JointState" "JointState"
    TRANSFORMS "/tf" "tf2_msgs/msg/TFMessage" "TFMessage"
    POINTS "/points" "sensor_msgs/msg/PointCloud2" "PointCloud2"
    DIAGNOSTICS "/diagnostics" "diagnostic_msgs/msg/DiagnosticArray" "DiagnosticArray"
}

/// A bag that is being written. `W` is its MCAP file.
pub struct Bag<W: Write + Seek = BufWriter<File>> {
    file: PathBuf,
    /// Where it has its `metadata.yaml`; `None` of a file alone.
    metadata: Option<PathBuf>,
    writer: Writer<W>,
    channels: BTreeMap<Topic, (u16, u64)>,
    span: Option<(u64, u64)>,
}

impl Bag {
    /// Begins a bag in `folder`, which must be empty or not there, with the rig file `rig` attached; `simulated` says what of the rig is simulated.
    ///
    /// # Errors
    /// [`RecordingError::NotEmpty`], [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn create(folder: &Path, rig: &str, simulated: Option<&str>) -> Result<Self, RecordingError> {
        let write = |error: std::io::Error| RecordingError::write(folder, &error.into());
        std::fs::create_dir_all(folder).map_err(write)?;
        if std::fs::read_dir(folder).map_err(write)?.next().is_some() {
            return Err(RecordingError::NotEmpty(folder.to_owned()));
        }
        let file = folder.join(FILE);
        let created = File::create(&file).map_err(write)?;
        let mut bag = Self::on(BufWriter::new(created), &file, rig)?;
        bag.metadata = Some(folder.join("metadata.yaml"));
        bag.describe()?;
        if let Some(simulated) = simulated {
            bag.say(SIMULATED, simulated)?;
        }
        // The rig file is on the disk before the first frame.
        bag.flush()?;
        Ok(bag)
    }
}

impl<W: Write + Seek> Bag<W> {
    /// Begins a bag whose MCAP file `writer` writes; `file` is its name in errors.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn on(writer: W, file: &Path, rig: &str) -> Result<Self, RecordingError> {
        let fail = |error| RecordingError::write(file, &error);
        // Each chunk is written at once, so that a program that dies leaves whole ones.
        let options = WriteOptions::new()
            .disable_seeking(true)
            .profile("ros2")
            .library(concat!("vergence ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.compression(None).chunk_size(Some(CHUNK)).create(writer).map_err(fail)?;
        let data = rig.as_bytes().into();
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: RIG.to_owned(),
            media_type: "application/toml".to_owned(),
            data,
        };
        writer.attach(&attachment).map_err(fail)?;
        Ok(Self { file: file.to_owned(), metadata: None, writer, channels: BTreeMap::new(), span: None })
    }

    /// Keeps a sentence of this name, which is none of the rig's.
    fn say(&mut self, name: &str, text: &str) -> Result<(), RecordingError> {
        let metadata = BTreeMap::from([(name.to_owned(), text.to_owned())]);
        let written = self.writer.write_metadata(&Metadata { name: PROGRAM.to_owned(), metadata });
        written.map_err(|error| RecordingError::write(&self.file, &error))
    }

    /// Appends a message of `topic`, heard at `at_ns` nanoseconds since 1970.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn write(&mut self, topic: Topic, at_ns: u64, message: &[u8]) -> Result<(), RecordingError> {
        let (channel_id, sequence) = match self.channels.get(&topic) {
            Some(&known) => known,
            None => (self.channel(topic)?, 0),
        };
        let sequence = sequence + 1;
        self.channels.insert(topic, (channel_id, sequence));
        let (first, last) = self.span.unwrap_or((at_ns, at_ns));
        self.span = Some((first.min(at_ns), last.max(at_ns)));
        // The count of a long recording begins anew.
        let header = MessageHeader { channel_id, sequence: sequence as u32, log_time: at_ns, publish_time: at_ns };
        self.writer.write_to_known_channel(&header, message).map_err(|error| RecordingError::write(&self.file, &error))
    }

    /// Brings all messages so far to the disk.
    ///
    /// # Errors
    /// As [`Bag::write`].
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(|error| RecordingError::write(&self.file, &error))
    }

    /// Ends the bag: writes what is not on the disk yet, and the index.
    ///
    /// # Errors
    /// As [`Bag::create`].
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map_err(|error| RecordingError::write(&self.file, &error))?;
        self.describe()
    }

    /// Writes `metadata.yaml` as it is now.
    fn describe(&self) -> Result<(), RecordingError> {
        let Some(path) = &self.metadata else { return Ok(()) };
        let topics: Vec<_> = self
            .channels
            .iter()
            .map(|(topic, &(_, count))| TopicCount { name: topic.name, kind: topic.kind, count })
            .collect();
        let written = std::fs::write(path, metadata(FILE, self.span, &topics));
        written.map_err(|error| RecordingError::write(path, &error.into()))
    }

    fn channel(&mut self, topic: Topic) -> Result<u16, RecordingError> {
        // A profile that is given in part stops strict readers; none is understood by all.
        let quality = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
        let schema = self.writer.add_schema(topic.kind, "ros2msg", topic.definition.as_bytes());
        let channel = schema.and_then(|schema| self.writer.add_channel(schema, topic.name, "cdr", &quality));
        channel.map_err(|error| RecordingError::write(&self.file, &error))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use std::io::{self, Cursor, SeekFrom};

    use super::*;

    /// A disk with room for this many bytes.
    struct Small(Cursor<Vec<u8>>, usize);

    impl Write for Small {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0.get_ref().len() + bytes.len() > self.1 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.0.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Small {
        fn seek(&mut self, place: SeekFrom) -> io::Result<u64> {
            self.0.seek(place)
        }
    }

    #[test]
    fn a_full_disk_is_named() {
        let disk = Small(Cursor::default(), 10_000);
        let mut bag = Bag::on(disk, Path::new("here"), "name = \"rig\"").expect("room for the beginning");
        let error = (0..100).find_map(|at| bag.write(EVENTS, at, &[0; 1000]).and_then(|()| bag.flush()).err());
        assert!(matches!(error, Some(RecordingError::DiskFull(file)) if file == Path::new("here")));
    }
}
