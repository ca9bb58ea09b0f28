"""Hears what a rig publishes over zenoh, as a program without ROS does: hear.py ADDRESS NAME FILE. Keeps the messages in FILE."""
import json
import pickle
import sys
import time

import zenoh

address, name, file = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("connect/endpoints", json.dumps([address]))
config.insert_json5("listen/endpoints", "[]")
config.insert_json5("scouting/multicast/enabled", "false")
heard = []


def hear(sample):
    attachment = None if sample.attachment is None else sample.attachment.to_bytes()
    heard.append((str(sample.key_expr), sample.payload.to_bytes(), attachment))


with zenoh.open(config) as session:
    subscriber = session.declare_subscriber("0/**", hear)
    topics = ["points", "tf", "joint_states", "diagnostics"]
    deadline = time.monotonic() + 90
    while True:
        count = {topic: sum(key.startswith(f"0/{name}/{topic}/") for key, _, _ in heard) for topic in topics}
        if count["points"] >= 4 and min(count.values()) >= 2:
            break
        assert time.monotonic() < deadline, count
        time.sleep(0.05)
    tokens = [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/**", timeout=5)]
with open(file, "wb") as out:
    pickle.dump((name, heard, tokens), out)
