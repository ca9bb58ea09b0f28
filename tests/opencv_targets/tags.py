"""Prints as JSON the AprilTags 36h11 with borders of two cells that OpenCV finds in an image: number, and its corners."""

import json
import sys

import cv2

image = cv2.imread(sys.argv[1], cv2.IMREAD_GRAYSCALE)
parameters = cv2.aruco.DetectorParameters()
parameters.markerBorderBits = 2
parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
parameters.cornerRefinementWinSize = 3
dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
found = zip([] if ids is None else ids.flatten(), corners)
print(json.dumps([{"id": int(number), "corners": tag[0].tolist()} for number, tag in found]))
