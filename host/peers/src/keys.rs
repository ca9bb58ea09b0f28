//! Keys, liveliness tokens and attachments as `rmw_zenoh` 0.2.4 and later has them (its `docs/design.md`), so that ROS 2 nodes can join.

use sha2::{Digest, Sha256};
use vergence_recording::{DIAGNOSTICS, JOINTS, POINTS, TRANSFORMS, Topic};

/// The number of the ROS domain.
pub const DOMAIN: u32 = 0;

/// The hashes of the types (REP 2011), as ROS 2 Jazzy has them.
const HASHES: [(Topic, &str); 4] = [
    (POINTS, "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"),
    (JOINTS, "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"),
    (TRANSFORMS, "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
    (DIAGNOSTICS, "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
];

/// Whether a rig may have this name: what a ROS 2 namespace may have.
#[must_use]
pub fn is_name(name: &str) -> bool {
    let rest = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    name.len() <= 64 && name.starts_with(|first: char| first.is_ascii_alphabetic()) && name.bytes().all(rest)
}

/// The type as DDS names it, such as `sensor_msgs::msg::dds_::PointCloud2_`, and its hash.
fn dds(topic: &Topic) -> String {
    let kind = match topic.kind.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => topic.kind.to_owned(),
    };
    let hash = HASHES.iter().find(|(known, _)| known == topic).map_or("TypeHashNotSupported", |(_, hash)| *hash);
    format!("{kind}/{hash}")
}

/// The key of a topic of `rig`: domain, topic, type and hash. `*` as a rig stands for all.
#[must_use]
pub fn data_key(rig: &str, topic: &Topic) -> String {
    format!("{DOMAIN}/{rig}{}/{}", topic.name, dds(topic))
}

/// The key at which `rig` takes orders; ROS 2 knows nothing of it.
#[must_use]
pub fn mode_key(rig: &str) -> String {
    format!("vergence/{rig}/mode")
}

/// The key of the liveliness token that tells ROS 2 nodes of a publisher of `rig`, number `number` of the zenoh session `session`; without a
/// topic, of the rig as a node. The quality of service is ROS 2's own default but the depth, which is one: only the latest counts.
#[must_use]
pub fn token_key(session: &str, rig: &str, number: usize, topic: Option<&Topic>) -> String {
    let kind = if topic.is_some() { "MP" } else { "NN" };
    // Node 0, no enclave, and the rig's name as namespace and as node.
    let node = format!("@ros2_lv/{DOMAIN}/{session}/0/{number}/{kind}/%/%{rig}/vergence");
    let of = |topic: &Topic| format!("{node}/%{rig}{}/{}/::,1:,:,:,,", topic.name.replace('/', "%"), dds(topic));
    topic.map_or(node.clone(), of)
}

/// What `rmw_zenoh` sends beside each message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Number of the message, from 1, in its topic.
    pub sequence: i64,
    /// When it was stamped, in nanoseconds since 1970.
    pub stamp_ns: i64,
    /// Which publisher sent it.
    pub publisher: [u8; 16],
}

impl Attachment {
    /// The number of the publisher that a liveliness token tells of.
    #[must_use]
    pub fn publisher(token: &str) -> [u8; 16] {
        let mut number = [0; 16];
        number.copy_from_slice(&Sha256::digest(token)[..16]);
        number
    }

    /// 33 bytes: both numbers, little-endian, the count 16, and the number of the publisher.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        [&self.sequence.to_le_bytes()[..], &self.stamp_ns.to_le_bytes(), &[16], &self.publisher].concat()
    }

    /// The attachment that these bytes are.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk()?;
        let (stamp, rest) = rest.split_first_chunk()?;
        let publisher = rest.strip_prefix(&[16])?.try_into().ok()?;
        Some(Self { sequence: i64::from_le_bytes(*sequence), stamp_ns: i64::from_le_bytes(*stamp), publisher })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_the_form_of_rmw_zenoh() {
        assert_eq!(
            data_key("bench", &POINTS),
            "0/bench/points/sensor_msgs::msg::dds_::PointCloud2_/\
             RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
        );
        assert_eq!(token_key("a1", "bench", 0, None), "@ros2_lv/0/a1/0/0/NN/%/%bench/vergence");
        assert_eq!(
            token_key("a1", "bench", 2, Some(&JOINTS)),
            "@ros2_lv/0/a1/0/2/MP/%/%bench/vergence/%bench%joint_states/sensor_msgs::msg::dds_::JointState_/\
             RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e/::,1:,:,:,,"
        );
    }

    #[test]
    fn names_are_those_that_a_namespace_may_have() {
        assert!(["a", "bench_1", "Left"].into_iter().all(is_name));
        assert!(!["", "1a", "_a", "a-b", "a/b", "*", "a b", "ä", &"a".repeat(65)].into_iter().any(is_name));
    }

    #[test]
    fn an_attachment_has_33_bytes_and_reads_back() {
        let publisher = Attachment::publisher("@ros2_lv/0/a1/0/0/NN/%/%bench/vergence");
        let attachment = Attachment { sequence: 7, stamp_ns: 1_700_000_000_000_000_123, publisher };
        let bytes = attachment.bytes();
        assert_eq!((bytes.len(), bytes[16], &bytes[..8]), (33, 16, &7_i64.to_le_bytes()[..]));
        assert_eq!(Attachment::read(&bytes), Some(attachment));
        for length in 0..33 {
            assert_eq!(Attachment::read(&bytes[..length]), None);
        }
        assert_eq!(Attachment::read(&[&bytes[..], &[0]].concat()), None);
    }
}
