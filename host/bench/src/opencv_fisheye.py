"""Nanoseconds per point of OpenCV's fisheye projection and unprojection, one thread, the least of several runs, into arrays that exist.

Arguments: points, repeats, fx, fy, cx, cy, k1, k2, k3, k4, largest angle to the axis in degrees.
"""
import json
import sys
import time

import cv2
import numpy as np

points, repeats = int(sys.argv[1]), int(sys.argv[2])
fx, fy, cx, cy, *k, degrees = map(float, sys.argv[3:])
cv2.setNumThreads(1)
i = np.arange(points)
theta, phi = np.radians(degrees) * (i + 0.5) / points, 2.399963 * i
rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1).reshape(-1, 1, 3)
camera, zero = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.zeros(3)
k = np.array(k)
pixels, _ = cv2.fisheye.projectPoints(rays, zero, zero, camera, k)
# distortPoints takes x / z and y / z, which end before 90 degrees.
tangent = np.tan(theta * 88 / degrees)
planar = np.stack([tangent * np.cos(phi), tangent * np.sin(phi)], axis=1).reshape(-1, 1, 2)


distorted, undistorted = np.empty_like(planar), np.empty_like(pixels)
derivatives = cv2.fisheye.projectPoints(rays, zero, zero, camera, k)[1]


def least(work):
    times = []
    work()
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e9 * min(times) / points


print(json.dumps({
    "project_ns": least(lambda: cv2.fisheye.distortPoints(planar, camera, k, distorted)),
    "derivatives_ns": least(lambda: cv2.fisheye.projectPoints(rays, zero, zero, camera, k, pixels, 0, derivatives)),
    "unproject_ns": least(lambda: cv2.fisheye.undistortPoints(pixels, camera, k, undistorted)),
    "version": cv2.__version__,
}))
