"""Reads a recording and the folders that were made of it, with none of our code: the same images, times, lenses and poses."""
import csv, json, sys
from pathlib import Path
import cv2
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

recording, tum_vi, euroc, views = map(Path, sys.argv[1:])
store = get_typestore(Stores.ROS2_HUMBLE)


def read(bag):
    messages = {}
    with AnyReader([bag], default_typestore=store) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic.startswith("/vergence"):
                continue
            message = store.deserialize_cdr(raw, connection.msgtype)
            assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(raw), connection.topic
            messages.setdefault(connection.topic, []).append(message)
    return messages


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def table(path):
    rows = list(csv.reader(open(path)))
    assert rows[0][0] == "#timestamp [ns]", rows[0]
    return rows[0], rows[1:]


def turn(q):
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def pose(p, q):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn(q), p
    return matrix


bag = read(recording)
pictures = {
    side: {stamp(m): cv2.imdecode(m.data, cv2.IMREAD_UNCHANGED) for m in bag[f"/{side}/image/compressed"]}
    for side in ["left", "right"]
}
head, stage = table(tum_vi / "mav0/stage0/data.csv")
rows = [dict(zip(head, row)) for row in stage]
numbers = lambda row, name, parts: [float(row[f"{name}_{part} [{'m' if name[0] == 'p' else ''}]"]) for part in parts]
left_from_right = [pose(numbers(r, "p_LR", "xyz"), numbers(r, "q_LR", "wxyz")) for r in rows]
base_from_left = [pose(numbers(r, "p_BL", "xyz"), numbers(r, "q_BL", "wxyz")) for r in rows]
for matrix in left_from_right:
    assert np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)

# The encoders were read at other instants, which the host heard a little later.
joints = bag["/joint_states"]
heard = np.array([stamp(m) for m in joints])
encoder_off = 0.0
for index, name in enumerate(joints[0].name):
    unit = "m" if name == "baseline" else "rad"
    told = np.array([float(r[f"{name} [{unit}]"]) for r in rows])
    times = np.array([int(r["timestamp_left [ns]"]) for r in rows])
    near = np.interp(times, heard, [m.position[index] for m in joints])
    encoder_off = max(encoder_off, np.abs(told - near).max() / np.ptp([m.position[index] for m in joints]))

# The images are those of the recording, at their times.
counted = 0
for camera, side in [("cam0", "left"), ("cam1", "right")]:
    _, images = table(tum_vi / "mav0" / camera / "data.csv")
    assert [row[0] for row in images] == [row["#timestamp [ns]"] for row in rows]
    for (time, name), row in zip(images, rows):
        assert name == time + ".png"
        picture = cv2.imread(str(tum_vi / "mav0" / camera / "data" / name), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(picture, pictures[side][int(row[f"timestamp_{side} [ns]"])]), (camera, time)
        counted += 1
    assert all(row["#timestamp [ns]"] == row["timestamp_left [ns]"] for row in rows)

# The lenses are those of CameraInfo, and T_BS is the pose of the first exposure.
infos = {side: bag[f"/{side}/camera_info"][0] for side in ["left", "right"]}
for camera, side in [("cam0", "left"), ("cam1", "right")]:
    sensor = YAML(typ="safe").load(tum_vi / "mav0" / camera / "sensor.yaml")
    info = infos[side]
    assert sensor["distortion_model"] == "equidistant" and sensor["resolution"] == [info.width, info.height]
    assert np.allclose(sensor["intrinsics"], info.k[[0, 4, 2, 5]]) and np.allclose(sensor["distortion_coefficients"], info.d)
    assert abs(sensor["rate_hz"] - 5) < 0.1, sensor["rate_hz"]
    body = np.array(sensor["T_BS"]["data"]).reshape(4, 4)
    assert np.allclose(body, np.eye(4) if camera == "cam0" else left_from_right[0], atol=1e-12), body


def by_opencv(side, picture, size, focal):
    info = infos[side]
    matrix = np.array([[focal, 0, (size - 1) / 2], [0, focal, (size - 1) / 2], [0, 0, 1]])
    maps = cv2.fisheye.initUndistortRectifyMap(info.k.reshape(3, 3), info.d, np.eye(3), matrix, (size, size), cv2.CV_32FC1)
    return cv2.remap(picture, *maps, cv2.INTER_CUBIC)


# The front views are what OpenCV makes of the fisheye images.
worst_mean = 0.0
for camera, side in [("cam0", "left"), ("cam1", "right")]:
    sensor = YAML(typ="safe").load(euroc / "mav0" / camera / "sensor.yaml")
    assert sensor["distortion_model"] == "radial-tangential" and sensor["distortion_coefficients"] == [0, 0, 0, 0]
    focal, size = sensor["intrinsics"][0], sensor["resolution"][0]
    assert abs(2 * np.degrees(np.arctan(size / 2 / focal)) - 90) < 1e-9
    for row in rows:
        picture = cv2.imread(str(euroc / "mav0" / camera / "data" / (row["#timestamp [ns]"] + ".png")), cv2.IMREAD_GRAYSCALE)
        source = pictures[side][int(row[f"timestamp_{side} [ns]"])]
        source = source if source.ndim == 2 else cv2.cvtColor(source, cv2.COLOR_BGR2GRAY)
        off = np.abs(picture.astype(float) - by_opencv(side, source, size, focal))
        worst_mean = max(worst_mean, off.mean())

# The bag of views: cameras without distortion, at their places, with the images of the folder.
seen = read(views)
for side in ["left", "right"]:
    for face in ["front", "left", "right", "up", "down"]:
        assert len(seen[f"/{side}/{face}/image"]) == len(seen[f"/{side}/{face}/camera_info"]) == len(rows)
    for message, info, row in zip(seen[f"/{side}/front/image"], seen[f"/{side}/front/camera_info"], rows):
        assert stamp(message) == stamp(info) == int(row[f"timestamp_{side} [ns]"])
        assert info.distortion_model == "plumb_bob" and not info.d.any() and np.allclose(info.p.reshape(3, 4)[:, :3], info.k.reshape(3, 3))
        assert message.header.frame_id == info.header.frame_id == side + "_front"
        channels = {"mono8": 1, "rgb8": 3}[message.encoding]
        pixels = message.data.reshape(message.height, message.width, channels)
        file = euroc / f"mav0/cam{int(side == 'right')}/data" / (row["#timestamp [ns]"] + ".png")
        assert np.array_equal(cv2.imread(str(file))[:, :, ::-1], np.broadcast_to(pixels, (*pixels.shape[:2], 3)))
frames_off = 0.0
for message, base, right in zip(seen["/tf"], base_from_left, left_from_right):
    chain = {}
    for t in message.transforms:
        p, q = t.transform.translation, t.transform.rotation
        chain[t.child_frame_id] = (t.header.frame_id, pose([p.x, p.y, p.z], [q.w, q.x, q.y, q.z]))
    assert chain["left"][0] == chain["right"][0] == "base" and chain["right_up"][0] == "right"
    frames_off = max(frames_off, np.abs(chain["left"][1] - base).max(), np.abs(chain["right"][1] - base @ right).max())
    assert np.allclose(chain["left_left"][1] @ [0, 0, 1, 1], [-1, 0, 0, 1])
    assert np.allclose(chain["right_up"][1] @ [0, 0, 1, 1], [0, -1, 0, 1])

moved = np.linalg.norm(left_from_right[-1][:3, 3] - left_from_right[0][:3, 3])
print(json.dumps({
    "images": counted, "moved_m": moved, "encoder_off": encoder_off, "front_off": worst_mean, "frames_off": frames_off,
}))
