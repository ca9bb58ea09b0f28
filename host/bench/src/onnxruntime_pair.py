"""Milliseconds that Python's onnxruntime takes to extract and match a pair, the median of several runs.

Arguments: manifest as JSON, folder of its files, picture (float32, rows), width, height, keypoints, threads, runs.
"""
import json
import sys
import time

import numpy as np
import onnxruntime

manifest = json.loads(sys.argv[1])
folder, picture = sys.argv[2:4]
width, height, keypoints, threads, runs = map(int, sys.argv[4:])
options = onnxruntime.SessionOptions()
options.intra_op_num_threads = threads
extractor, matcher = (manifest["networks"]["separate"][part] for part in ("extractor", "matcher"))
sessions = [
    onnxruntime.InferenceSession(f"{folder}/{part['file']}", options, providers=["CPUExecutionProvider"])
    for part in (extractor, matcher)
]
channels = manifest["image"]["channels"]
image = np.fromfile(picture, np.float32).reshape(1, 1, height, width).repeat(channels, axis=1)
size = np.array([width, height], np.float32)


def extract():
    names = [extractor[name] for name in ("keypoints", "descriptors", "scores")]
    places, descriptors, scores = sessions[0].run(names, {extractor["image"]: image})
    count = min(keypoints, int((scores.reshape(-1) > 0).sum()))
    places = places.reshape(-1, 2)[:count].astype(np.float32)
    if matcher["coordinates"] == "centred":
        places = (places - size / 2) / (size.max() / 2)
    return places[None], descriptors.reshape(1, -1, extractor["descriptor_width"])[:, :count]


def pair():
    inputs = {}
    for side in range(2):
        inputs[matcher["keypoints"][side]], inputs[matcher["descriptors"][side]] = extract()
    result = matcher["result"]
    return sessions[1].run([result["matches"], result["scores"]], inputs), inputs[matcher["keypoints"][0]].shape[1]


_, found = pair()
times = []
for _ in range(runs):
    start = time.perf_counter()
    pair()
    times.append(1e3 * (time.perf_counter() - start))
print(json.dumps({"median_ms": float(np.median(times)), "least_ms": min(times), "keypoints": found,
                  "version": onnxruntime.__version__}))
