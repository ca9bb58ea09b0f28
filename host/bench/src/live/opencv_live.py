# Times OpenCV's ORB with brute-force matching, and pyramidal Lucas-Kanade, on pairs of images: left and right files in turn.
import json
import sys
import time

import cv2

pairs = [[cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in sys.argv[i : i + 2]] for i in range(1, len(sys.argv), 2)]
orb = cv2.ORB_create(nfeatures=2000)
matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)


def by_orb(left, right):
    (one, first), (other, second) = (orb.detectAndCompute(image, None) for image in (left, right))
    found = matcher.match(first, second)
    return [[*one[m.queryIdx].pt, *other[m.trainIdx].pt] for m in found]


def by_flow(left, right):
    points = cv2.goodFeaturesToTrack(left, 800, 0.01, 7)
    there, status, _ = cv2.calcOpticalFlowPyrLK(left, right, points, None, winSize=(21, 21), maxLevel=5)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(right, left, there, None, winSize=(21, 21), maxLevel=5)
    rows = zip(points.reshape(-1, 2), there.reshape(-1, 2), back.reshape(-1, 2), status.ravel() * returned.ravel())
    return [[float(v) for v in (*p, *q)] for p, q, r, ok in rows if ok and abs(p - r).max() < 1.0]


def measured(work):
    times, found = [], []
    for left, right in pairs:
        start = time.perf_counter()
        matches = work(left, right)
        times.append(1e3 * (time.perf_counter() - start))
        found.append(matches)
    return {"milliseconds": times, "matches": found}


print(json.dumps({"version": cv2.__version__, "orb": measured(by_orb), "flow": measured(by_flow)}))
