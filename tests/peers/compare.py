"""What was heard of a rig is what its recording of the same run holds: compare.py RECORDING FILE. FILE is what hear.py wrote."""
import pickle
import struct
import sys
from collections import Counter
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

bag = Path(sys.argv[1])
with open(sys.argv[2], "rb") as file:
    name, heard, tokens = pickle.load(file)
store = get_typestore(Stores.ROS2_JAZZY)
recorded = {}
with AnyReader([bag], default_typestore=store) as reader:
    for connection, _, raw in reader.messages():
        recorded.setdefault(connection.topic, set()).add(bytes(raw))

counts, numbers, publishers = Counter(), {}, {}
for key, payload, attachment in heard:
    domain, rig, topic, dds, hash = key.split("/")
    assert (domain, rig) == ("0", name), key
    package, kind, _, type = dds.split("::")
    message_type = f"{package}/{kind}/{type.removesuffix('_')}"
    # The hash is that of the type, which rosbags computes from its definition.
    assert hash == store.hash_rihs01(message_type), (key, store.hash_rihs01(message_type))
    message = store.deserialize_cdr(payload, message_type)
    assert bytes(store.serialize_cdr(message, message_type)) == payload, key
    if topic != "diagnostics":
        assert payload in recorded["/" + topic], f"{topic} is not as it was recorded"
    # Number, time stamp, and the publisher, as rmw_zenoh has them.
    number, stamp_ns, length = struct.unpack("<qqB", attachment[:17])
    assert len(attachment) == 33 and length == 16
    assert number > numbers.get(topic, 0), (topic, number)
    assert publishers.setdefault(topic, attachment[17:]) == attachment[17:]
    if topic != "tf":
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == stamp_ns, topic
    counts[topic] += 1
    numbers[topic] = number
    if topic == "points":
        assert message.width > 20 and message.header.frame_id == "left", message.width
        assert {"x", "sigma_range", "cov_xx", "rgba"} <= {field.name for field in message.fields}
    if topic == "diagnostics":
        assert {status.name for status in message.status} == {"board", "publishing"}
kinds = Counter(token.split("/")[5] for token in tokens)
assert kinds == {"NN": 1, "MP": 4}, tokens
assert any(f"%{name}%points/sensor_msgs::msg::dds_::PointCloud2_/" in token for token in tokens), tokens
print("heard as recorded:", dict(counts))
