"""Writes camera files with cv2.FileStorage into a folder, and prints what OpenCV projects with the same cameras."""

import json
import sys

import cv2
import numpy as np

folder = sys.argv[1]
zero = np.zeros(3)
K = np.array([[600.0, 0.0, 1024.0], [0.0, 601.0, 1022.0], [0.0, 0.0, 1.0]])
skewed = np.array([[1500.0, 0.4, 1024.0], [0.0, 1501.0, 1022.0], [0.0, 0.0, 1.0]])
four = [-0.05, 0.01, 1e-3, -5e-4]
rational = [0.2, -0.1, 1e-3, -5e-4, 0.02, 0.5, 0.1, 0.01]
prism = rational + [1e-3, -1e-3, 5e-4, 2e-4]
equidistant = [-0.02, 0.003, -0.001, 0.0002]
ahead = np.array([[0.3, -0.2, 0.9], [-0.7, 0.4, 0.8], [0.02, 0.5, 0.6], [0.0, 0.0, 1.0]])
around = np.vstack([ahead, [[-0.7, 0.4, -0.1], [0.3, 0.9, -0.3]]])


def pinhole(D):
    return cv2.projectPoints(ahead.reshape(-1, 1, 3), zero, zero, K, np.array(D or [0.0] * 4))[0].reshape(-1, 2)


cases = {
    "pinhole0": (K, [], {}, ahead, pinhole([])),
    "pinhole4": (K, four, {"model": "pinhole"}, ahead, pinhole(four)),
    "pinhole5": (K, four + [0.002], {}, ahead, pinhole(four + [0.002])),
    "pinhole8": (K, rational, {}, ahead, pinhole(rational)),
    "pinhole12": (K, prism, {}, ahead, pinhole(prism)),
    "pinhole14": (K, prism + [0.02, -0.01], {}, ahead, pinhole(prism + [0.02, -0.01])),
    "fisheye": (
        K,
        equidistant,
        {"fisheye_model": 1},
        ahead,
        cv2.fisheye.projectPoints(ahead.reshape(-1, 1, 3), zero, zero, K, np.array(equidistant))[0].reshape(-1, 2),
    ),
    "omnidir": (
        skewed,
        four,
        {"xi": np.array([1.5])},
        around,
        cv2.omnidir.projectPoints(around.reshape(1, -1, 3), zero, zero, skewed, 1.5, np.array(four))[0].reshape(-1, 2),
    ),
}


def write(name, values):
    path = f"{folder}/{name}.yaml"
    file = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        file.write(key, value)
    file.release()
    return path


said = []
for name, (matrix, D, more, points, pixels) in cases.items():
    distortion = {"distortion_coefficients": np.array(D)} if D else {}
    path = write(name, {"image_width": 2048, "image_height": 2044, "camera_matrix": matrix} | distortion | more)
    said.append({"name": name, "file": path, "rays": points.tolist(), "pixels": pixels.tolist()})
# A pair, as stereoCalibrate gives it.
R, T = cv2.Rodrigues(np.array([0.1, 0.8, -0.05]))[0], np.array([[-140.0], [3.0], [20.0]])
D = np.array(rational)
values = {"image_width": 2048, "image_height": 2044, "translation_unit": "mm", "K1": K, "D1": D, "K2": K, "D2": D, "R": R, "T": T}
left = np.array([[100.0, -50.0, 400.0]])
right = R @ left.T + T
print(json.dumps({"cameras": said, "pair": write("pair", values), "left": left[0].tolist(), "right": right.ravel().tolist()}))
