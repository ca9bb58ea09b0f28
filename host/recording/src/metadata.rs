//! `metadata.yaml` of a ROS 2 bag, version 5: what rosbag2 wants to know before it opens the MCAP file.

use std::fmt::Write;

/// A topic and the number of its messages.
pub struct TopicCount {
    /// Its name.
    pub name: &'static str,
    /// The name of its messages' type.
    pub kind: &'static str,
    /// The number of its messages.
    pub count: u64,
}

/// The text of `metadata.yaml` for a bag with the MCAP file `file`, whose messages are of the times `span` in nanoseconds.
pub fn metadata(file: &str, span: Option<(u64, u64)>, topics: &[TopicCount]) -> String {
    let (first, last) = span.unwrap_or_default();
    let (length, messages) = (last - first, topics.iter().map(|topic| topic.count).sum::<u64>());
    let mut text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {length}\n  \
         starting_time:\n    nanoseconds_since_epoch: {first}\n  message_count: {messages}\n  topics_with_message_count:{}\n",
        if topics.is_empty() { " []" } else { "" }
    );
    for TopicCount { name, kind, count } in topics {
        // Writing to a text does not fail.
        let _ = write!(
            text,
            "    - topic_metadata:\n        name: {name}\n        type: {kind}\n        serialization_format: cdr\n        \
             offered_qos_profiles: \"\"\n      message_count: {count}\n"
        );
    }
    let _ = write!(
        text,
        "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
         starting_time:\n        nanoseconds_since_epoch: {first}\n      duration:\n        nanoseconds: {length}\n      \
         message_count: {messages}\n"
    );
    text
}
