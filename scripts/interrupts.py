"""Ctrl-C at many moments of every long function, on a large cloud: how long until KeyboardInterrupt?

    python scripts/interrupts.py CLOUD [MOMENTS] [WORD ...]

Each function runs once to the end for its time, then MOMENTS times (default 5) with SIGINT at a share of that time: shortly
after the beginning, shortly before the end, the others by chance. With words, only functions whose name has one of them. Prints
the longest wait of each in seconds; the aim is 0.2 s. Takes hours on 10 million points: cut pursuit alone is half of them.
"""

import copy
import os
import random
import signal
import sys
import tempfile
import threading
import time

import numpy as np
import scansion
from scansion import evaluation, features, graph, neighbours, regularisation, segmentation, terrain

EARLY, LATE = 0.02, 0.97
METHODS = ("slic", "vccs", "local-graph", "riemannian", "region-growing", "octree-region-growing", "merge", "cut-pursuit", "felzenszwalb")
METHODS += ("clusters",)


def interrupted(work, after):
    """Seconds from SIGINT to KeyboardInterrupt; None if the work had finished before."""
    sent = []

    def send():
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    wait = None
    timer = threading.Timer(after, send)
    timer.start()
    try:
        try:
            work()
        except KeyboardInterrupt:
            wait = time.perf_counter() - sent[0]
        timer.cancel()
        timer.join()
    except KeyboardInterrupt:
        # The signal came after the end of the work.
        timer.join()
    return wait


def on_points(cloud, xyz):
    """Functions of the points alone."""
    works = {
        "cloud xyz": lambda: cloud.xyz,
        "cloud from array": lambda: scansion.PointCloud(xyz),
        "knn": lambda: neighbours.knn(xyz, k=10),
        "normals": lambda: features.normals(xyz),
        "optimal": lambda: neighbours.optimal(xyz, k_max=20, k_step=5),
        "multiscale": lambda: features.multiscale(xyz, first_scale=0.8, levels=2),
        "predict": lambda: scansion.PointClassifier.default().predict(cloud),
        "ground points": lambda: terrain.ground_points(cloud),
        "heights": lambda: terrain.heights(cloud, np.arange(len(cloud)) % 10 == 0),
        "knn_graph": lambda: graph.knn_graph(xyz),
        "render": lambda: scansion.render(cloud, width=800),
        "suggest": lambda: scansion.suggest(cloud, method="slic"),
    }
    for method in METHODS:
        works[f"segment {method}"] = lambda method=method: scansion.segment(cloud, method=method)
    return works


def on_graph(xyz):
    """Functions of a graph, which is made when the first of them is asked for."""
    made = []

    def parts():
        if not made:
            edges, weights = graph.knn_graph(xyz, k=6, weights="inverse")
            z = (xyz[:, 2:3] - xyz[:, 2].min()).astype(np.float32)
            costs = np.concatenate([np.abs(z - height) / 10 for height in (0, 10, 30)], 1)
            made.extend((edges, weights, z, costs))
        return made

    def work(function):
        return lambda: function(*parts())

    nodes, aim = len(xyz), segmentation.PartitionParams(segments_per_hectare=200, method="merge")
    return parts, {
        "components": work(lambda e, w, z, c: graph.connected_components(nodes, e)),
        "spanning tree": work(lambda e, w, z, c: graph.minimum_spanning_tree(nodes, e, w)),
        "felzenszwalb": work(lambda e, w, z, c: graph.felzenszwalb(nodes, e, w)),
        "alpha expansion": work(lambda e, w, z, c: regularisation.alpha_expansion(c, e, w)),
        "alpha-beta swap": work(lambda e, w, z, c: regularisation.alpha_beta_swap(c, e, w)),
        "icm": work(lambda e, w, z, c: regularisation.icm(c, e, w)),
        "energy": work(lambda e, w, z, c: regularisation.energy(c.argmin(1), c, e, w)),
        "local smoothing": work(lambda e, w, z, c: regularisation.local_smoothing(np.exp(-c), e, w)),
        "merge regions": work(lambda e, w, z, c: segmentation.merge(z, e, w, strength=1.0)),
        "cut pursuit": work(lambda e, w, z, c: segmentation.cut_pursuit(z, e, w, strength=1.0)),
        "partition": work(lambda e, w, z, c: segmentation.partition(z, e, aim, weights=w, xyz=xyz)),
    }


def on_labels(cloud, xyz):
    """Functions of labels: evaluation and learning."""
    codes = cloud["Classification"]
    squares = (xyz[:, :2] // 30).astype(np.int64)
    segments = ((squares[:, 0] - squares[:, 0].min()) * 1000 + squares[:, 1] - squares[:, 1].min()).astype(np.uint32)
    few = np.where(np.arange(len(cloud)) % 5000 == 0, codes.astype(np.int16), -1)
    table = np.concatenate([xyz, np.sqrt(np.abs(xyz))], 1).astype(np.float32)
    trees = {
        "forest": scansion.RandomForestClassifier(3),
        "bagging": scansion.BaggingClassifier(3),
        "boosting": scansion.GradientBoostingClassifier(3),
    }
    works = {
        "confusion": lambda: evaluation.confusion_matrix(codes, np.roll(codes, 1000)),
        "segmentation error": lambda: evaluation.segmentation_error(xyz, segments, codes),
        "object features": lambda: segmentation.object_features(xyz, segments),
        "fit points": lambda: scansion.PointClassifier().fit(cloud),
        "fit objects": lambda: scansion.ObjectClassifier().fit(cloud),
        "fit weak": lambda: scansion.WeakClassifier().fit(cloud, few),
    }
    for name, estimator in trees.items():
        works[f"{name} fit"] = lambda estimator=estimator: estimator.fit(table, codes)
        trained = copy.copy(estimator).fit(table[::100], codes[::100])
        works[f"{name} predict"] = lambda trained=trained: trained.predict_proba(table)
    return works


def on_files(path, cloud, folder):
    """Functions of files; what one of them writes another one reads."""
    las, other = os.path.join(folder, "a.las"), os.path.join(folder, "b.laz")
    scansion.write(las, cloud)
    works = {
        "read": lambda: scansion.read(path),
        "blocks": lambda: [len(block) for block in scansion.blocks(path)],
        "info": lambda: scansion.info(path, stats=True),
        "diff": lambda: scansion.diff(las, path),
        "convert": lambda: scansion.convert(las, other),
        "rewrite": lambda: scansion.rewrite(las, other, cloud["Classification"]),
        "merge files": lambda: scansion.merge([las, path], other),
        "salvage": lambda: scansion.salvage(las),
    }
    for extension in ("las", "laz", "ply", "pcd", "npz"):
        target = os.path.join(folder, f"c.{extension}")
        works[f"write {extension}"] = lambda target=target: scansion.write(target, cloud)
        works[f"read {extension}"] = lambda target=target: scansion.read(target)
    return works


def measure(name, work, moments, chance):
    begin = time.perf_counter()
    work()
    whole = time.perf_counter() - begin
    shares = [EARLY, LATE, *(chance.uniform(EARLY, LATE) for _ in range(moments - 2))]
    waits = [interrupted(work, whole * share) for share in shares[:moments]]
    caught = [w for w in waits if w is not None]
    longest = max(caught, default=float("nan"))
    print(f"{name:32} {whole:8.1f} s   {len(caught)} of {moments} caught   longest wait {longest:.2f} s", flush=True)


def main():
    signal.signal(signal.SIGINT, signal.default_int_handler)
    path, moments = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    words = sys.argv[3:]
    cloud = scansion.read(path)
    xyz = np.ascontiguousarray(cloud.xyz)
    chance = random.Random(0)
    prepare, graphs = on_graph(xyz)
    with tempfile.TemporaryDirectory() as folder:
        for works in (on_points(cloud, xyz), graphs, on_labels(cloud, xyz), on_files(path, cloud, folder)):
            for name, work in works.items():
                if not words or any(word in name for word in words):
                    if name in graphs:
                        prepare()
                    measure(name, work, moments, chance)


if __name__ == "__main__":
    main()
