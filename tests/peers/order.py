"""Sends a rig to a mode, as docs/several-machines.md says, and tries what an eavesdropper would: order.py ADDRESS NAME SECRET_FILE MODE."""
import hmac
import json
import sys
import time

import zenoh

address, name, secret_file, mode = sys.argv[1:]
secret = open(secret_file, "rb").read().strip()
config = zenoh.Config()
config.insert_json5("connect/endpoints", json.dumps([address]))
config.insert_json5("listen/endpoints", "[]")
config.insert_json5("scouting/multicast/enabled", "false")


def tag(number, secret=secret):
    return hmac.new(secret, f"vergence mode 1\n{name}\n{number}\n{mode}".encode(), "sha256").hexdigest()


with zenoh.open(config) as session:

    def ask(**question):
        for _ in range(40):
            for reply in session.get(f"vergence/{name}/mode", payload=json.dumps(question), timeout=5):
                return json.loads(reply.ok.payload.to_bytes())
            time.sleep(0.25)
        raise SystemExit("no rig answers")

    def refused(word, **question):
        answer = ask(**question)
        assert answer["is"] == "refused" and word in answer["why"], (question, answer)

    number = ask(ask="number")["number"]
    order = {"ask": "mode", "mode": mode, "number": number, "tag": tag(number)}
    refused("secret", **{**order, "tag": tag(number, b"a guess of more than sixteen letters")})
    refused("secret", **{**order, "mode": "herbivore"})
    refused("never given out", **{**order, "number": "00", "tag": tag("00")})
    answer = ask(**order)
    assert answer == {"is": "moving"}, answer
    refused("used", **order)
    while (answer := ask(ask="progress", number=number))["is"] == "moving":
        time.sleep(0.2)
    assert answer == {"is": "reached"}, answer
    refused("used", **order)
    refused("no such order", ask="progress", number="00")
    refused("question", ask="fly")
print("accepted once, refused when overheard")
