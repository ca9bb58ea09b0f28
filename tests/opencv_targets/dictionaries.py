"""Prints dictionaries of ArUco markers of OpenCV's: one marker a line, its cells row by row as hexadecimal digits, 1 is white.

The files of markers are made by it: dictionaries.py DICT_4X4_1000 > host/targets/src/detect/tags/dict_4x4_1000.txt
"""

import sys

import cv2

for name in sys.argv[1:]:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    side = dictionary.markerSize
    for marker in dictionary.bytesList:
        bits = cv2.aruco.Dictionary.getBitsFromByteList(marker.reshape(1, *marker.shape), side)
        cells = "".join(str(bit) for bit in bits.flatten())
        print(f"{int(cells, 2):0{-(-side * side // 4)}x}")
