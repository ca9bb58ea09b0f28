"""Boards that OpenCV's detectors find in images, and the median milliseconds for an image, one thread, reading left out.

Arguments: inner corners in a row, in a column, image files. Each detector sees the image before the next one is read.
"""
import json
import sys
import time

import cv2
import numpy as np

pattern, paths = (int(sys.argv[1]), int(sys.argv[2])), sys.argv[3:]
cv2.setNumThreads(1)
QUICK = cv2.CALIB_CB_NORMALIZE_IMAGE
THOROUGH = QUICK | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY


def classic(image):
    found, corners = cv2.findChessboardCorners(image, pattern, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | QUICK)
    if not found:
        return False
    grid = corners.reshape(pattern[1], pattern[0], 2)
    spacing = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
    half = int(max(2, min(5, 0.4 * spacing)))
    cv2.cornerSubPix(image, corners.astype(np.float32), (half, half), (-1, -1), (3, 60, 1e-4))
    return True


ways = {
    "classic": classic,
    "sb": lambda image: cv2.findChessboardCornersSB(image, pattern, flags=QUICK)[0],
    "sb_thorough": lambda image: cv2.findChessboardCornersSB(image, pattern, flags=THOROUGH)[0],
}
boards, times = dict.fromkeys(ways, 0), {name: [] for name in ways}
for path in paths:
    image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    for name, detect in ways.items():
        start = time.perf_counter()
        boards[name] += bool(detect(image))
        times[name].append(1e3 * (time.perf_counter() - start))
print(json.dumps({name: {"boards": boards[name], "median_ms": float(np.median(times[name]))} for name in ways}))
