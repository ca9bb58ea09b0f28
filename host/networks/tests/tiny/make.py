"""Writes the tiny networks beside this file: `pip install onnx`, then `python make.py`.

Each has the tensors of one export of the LightGlue family and next to no weights: keypoints sit on fixed places,
descriptors are one-hot, and matching is a product of descriptors and its largest entry."""

from pathlib import Path

import numpy as np
from onnx import TensorProto as T
from onnx import checker, helper, numpy_helper, save

HERE = Path(__file__).parent
N = 4
PLACES = np.array([[8, 8], [24, 8], [8, 24], [24, 24]], np.float32)


def constant(name, array):
    return helper.make_node("Constant", [], [name], value=numpy_helper.from_array(np.asarray(array), name + "_value"))


def write(name, nodes, inputs, outputs):
    value = lambda n, t, s: helper.make_tensor_value_info(n, t, s)
    graph = helper.make_graph(nodes, name, [value(*i) for i in inputs], [value(*o) for o in outputs])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    checker.check_model(model)
    save(model, HERE / f"{name}.onnx")


def extractor(name, channels, width):
    """Keypoints lit by the picture score above zero; dark ones end the list."""
    nodes = [
        constant("places", PLACES[None]),
        constant("described", np.eye(N, width, dtype=np.float32)[None]),
        helper.make_node("ReduceMean", ["image"], ["mean"], axes=[1, 2, 3], keepdims=0),
        constant("ones", np.ones((1, N), np.float32)),
        helper.make_node("Identity", ["places"], ["keypoints"]),
        helper.make_node("Identity", ["described"], ["descriptors"]),
        helper.make_node("Mul", ["ones", "mean"], ["scores"]),
    ]
    write(name, nodes, [("image", T.FLOAT, [1, channels, "h", "w"])],
          [("keypoints", T.FLOAT, [1, N, 2]), ("descriptors", T.FLOAT, [1, N, width]), ("scores", T.FLOAT, [1, N])])


def product(width):
    """best [1, N0] and its value [1, N0]."""
    return [
        helper.make_node("Transpose", ["desc1"], ["turned"], perm=[0, 2, 1]),
        helper.make_node("MatMul", ["desc0", "turned"], ["likeness"]),
        helper.make_node("ArgMax", ["likeness"], ["best"], axis=2, keepdims=0),
        helper.make_node("ReduceMax", ["likeness"], ["value"], axes=[2], keepdims=0),
    ]


def glue_inputs(width):
    return [("kpts0", T.FLOAT, [1, "n0", 2]), ("kpts1", T.FLOAT, [1, "n1", 2]),
            ("desc0", T.FLOAT, [1, "n0", width]), ("desc1", T.FLOAT, [1, "n1", width])]


def glue_per_keypoint(name, width):
    nodes = product(width) + [
        helper.make_node("Identity", ["best"], ["matches0"]),
        helper.make_node("Identity", ["value"], ["mscores0"]),
    ]
    write(name, nodes, glue_inputs(width), [("matches0", T.INT64, [1, "n0"]), ("mscores0", T.FLOAT, [1, "n0"])])


def glue_pairs(name, width):
    nodes = product(width) + [
        constant("first", np.array([0], np.int64)),
        helper.make_node("Squeeze", ["best", "first"], ["right"]),
        helper.make_node("Squeeze", ["value", "first"], ["mscores0"]),
        helper.make_node("Shape", ["right"], ["length"]),
        helper.make_node("Squeeze", ["length", "first"], ["count"]),
        constant("zero", np.int64(0)),
        constant("one", np.int64(1)),
        helper.make_node("Range", ["zero", "count", "one"], ["left"]),
        constant("last", np.array([1], np.int64)),
        helper.make_node("Unsqueeze", ["left", "last"], ["left2"]),
        helper.make_node("Unsqueeze", ["right", "last"], ["right2"]),
        helper.make_node("Concat", ["left2", "right2"], ["matches0"], axis=1),
    ]
    write(name, nodes, glue_inputs(width), [("matches0", T.INT64, ["m", 2]), ("mscores0", T.FLOAT, ["m"])])


def pipeline(name, channels):
    """Two pictures in one batch; every keypoint matches its like, scored by the pictures' mean."""
    pairs = np.array([[0, i, i] for i in range(N)], np.int64)
    nodes = [
        constant("both", np.stack([PLACES, PLACES]).astype(np.int64)),
        constant("pairs", pairs),
        helper.make_node("ReduceMean", ["images"], ["mean"], axes=[0, 1, 2, 3], keepdims=0),
        constant("ones", np.ones(N, np.float32)),
        helper.make_node("Identity", ["both"], ["keypoints"]),
        helper.make_node("Identity", ["pairs"], ["matches"]),
        helper.make_node("Mul", ["ones", "mean"], ["mscores"]),
    ]
    write(name, nodes, [("images", T.FLOAT, [2, channels, "h", "w"])],
          [("keypoints", T.INT64, [2, N, 2]), ("matches", T.INT64, [N, 3]), ("mscores", T.FLOAT, [N])])


def end_to_end(name, channels):
    """Two pictures by name."""
    nodes = [
        constant("places", PLACES),
        constant("pairs", np.array([[i, i] for i in range(N)], np.int64)),
        helper.make_node("ReduceMean", ["image0"], ["mean0"], axes=[0, 1, 2, 3], keepdims=0),
        helper.make_node("ReduceMean", ["image1"], ["mean1"], axes=[0, 1, 2, 3], keepdims=0),
        helper.make_node("Mul", ["mean0", "mean1"], ["mean"]),
        constant("ones", np.ones(N, np.float32)),
        helper.make_node("Identity", ["places"], ["kpts0"]),
        helper.make_node("Identity", ["places"], ["kpts1"]),
        helper.make_node("Identity", ["pairs"], ["matches0"]),
        helper.make_node("Mul", ["ones", "mean"], ["mscores0"]),
    ]
    write(name, nodes, [("image0", T.FLOAT, [1, channels, "h", "w"]), ("image1", T.FLOAT, [1, channels, "h", "w"])],
          [("kpts0", T.FLOAT, [N, 2]), ("kpts1", T.FLOAT, [N, 2]), ("matches0", T.INT64, [N, 2]),
           ("mscores0", T.FLOAT, [N])])


for width in (64, 128, 256):
    extractor(f"extractor{width}", 3 if width == 128 else 1, width)
    glue_per_keypoint(f"per_keypoint{width}", width)
    glue_pairs(f"pairs{width}", width)
pipeline("pipeline", 3)
end_to_end("end_to_end", 1)
