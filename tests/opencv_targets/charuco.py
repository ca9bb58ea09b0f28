"""OpenCV's ChArUco boards.

charuco.py find IMAGE BOARD prints as JSON the corners that OpenCV finds in an image: number, and place.
charuco.py draw IMAGE BOARD draws a board as OpenCV prints it, seen aslant, and prints where its corners are.

BOARD is: columns and rows of squares, sides of a square and of a marker, dictionary, and 1 for the legacy pattern, else 0.
"""

import json
import sys

import cv2
import numpy

verb, image, columns, rows, square, marker, dictionary, legacy = sys.argv[1:]
size = (int(columns), int(rows))
dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
board = cv2.aruco.CharucoBoard(size, float(square), float(marker), dictionary)
board.setLegacyPattern(legacy == "1")
if verb == "find":
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(cv2.imread(image, cv2.IMREAD_GRAYSCALE))
    ids, corners = ([], []) if ids is None else (ids.flatten(), corners.reshape(-1, 2))
else:
    SIDE, MARGIN, FINER = 60, 40, 4
    flat = board.generateImage(tuple(FINER * (n * SIDE + 2 * MARGIN) for n in size), None, FINER * MARGIN, 1)
    height, width = (n // FINER for n in flat.shape)
    seen = numpy.float32([[60, 20], [width + 30, 70], [width - 20, height + 60], [20, height - 10]])
    drawn = numpy.float32([[0, 0], [width, 0], [width, height], [0, height]])
    aslant = cv2.getPerspectiveTransform(drawn, seen)
    # Places in pixels of the large picture, whose centres are whole numbers, to those of the small one.
    finer = numpy.float64([[1 / FINER, 0, 0.5 / FINER], [0, 1 / FINER, 0.5 / FINER], [0, 0, 1]])
    centred = numpy.float64([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])
    large = numpy.diag([FINER, FINER, 1.0])
    picture = cv2.warpPerspective(
        flat,
        centred @ large @ aslant @ finer,
        (FINER * (width + 80), FINER * (height + 80)),
        flags=cv2.INTER_LINEAR,
        borderValue=160,
    )
    small = cv2.resize(picture, (width + 80, height + 80), interpolation=cv2.INTER_AREA)
    cv2.imwrite(image, cv2.GaussianBlur(small, (0, 0), 0.7))
    places = board.getChessboardCorners()[:, :2] * (SIDE / float(square)) + MARGIN
    corners = cv2.perspectiveTransform(places.reshape(-1, 1, 2).astype(numpy.float64), centred @ aslant).reshape(-1, 2)
    ids = range(len(corners))
print(json.dumps([{"id": int(number), "corner": corner.tolist()} for number, corner in zip(ids, corners)]))
