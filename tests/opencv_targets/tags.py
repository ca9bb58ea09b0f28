"""Prints as JSON the AprilTags 36h11 with borders of two cells that OpenCV finds in an image: number, and its corners.

The corners are refined by cornerSubPix, as Kalibr does: the small squares make saddle points of them.
"""

import json
import sys

import cv2

image = cv2.imread(sys.argv[1], cv2.IMREAD_GRAYSCALE)
parameters = cv2.aruco.DetectorParameters()
parameters.markerBorderBits = 2
dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
enough = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 0.001)
found = []
for number, tag in zip([] if ids is None else ids.flatten(), corners):
    refined = cv2.cornerSubPix(image, tag.reshape(4, 1, 2).copy(), (5, 5), (-1, -1), enough)
    found.append({"id": int(number), "corners": refined.reshape(4, 2).tolist()})
print(json.dumps(found))
