"""Ctrl-C at chance moments of the long functions, on a large cloud: how long until KeyboardInterrupt?

    python scripts/interrupts.py CLOUD [MOMENTS]

Each function runs once to the end for its time, then MOMENTS times (default 5) with SIGINT at a share of that time.
Prints the longest wait of each in seconds; the aim is 0.2 s. Takes some minutes on 10 million points.
"""

import os
import random
import signal
import sys
import threading
import time

import numpy as np
import scansion
from scansion import features, graph, neighbours


def interrupted(work, after):
    """Seconds from SIGINT to KeyboardInterrupt; None if the work was over before."""
    sent = []

    def send():
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, send)
    timer.start()
    try:
        work()
    except KeyboardInterrupt:
        return time.perf_counter() - sent[0]
    finally:
        timer.cancel()
        timer.join()
    return None


def main():
    signal.signal(signal.SIGINT, signal.default_int_handler)
    path, moments = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    cloud = scansion.read(path)
    xyz = np.ascontiguousarray(cloud.xyz)
    works = {
        "knn": lambda: neighbours.knn(xyz, k=10),
        "knn_graph": lambda: graph.knn_graph(xyz),
        "multiscale": lambda: features.multiscale(xyz, first_scale=0.8, levels=2),
        "predict": lambda: scansion.PointClassifier.default().predict(cloud),
    }
    for method in ["slic", "vccs", "local-graph", "riemannian", "region-growing"]:
        works[f"segment {method}"] = lambda method=method: scansion.segment(cloud, method=method)
    chance = random.Random(0)
    for name, work in works.items():
        begin = time.perf_counter()
        work()
        whole = time.perf_counter() - begin
        waits = [interrupted(work, whole * chance.uniform(0.02, 0.98)) for _ in range(moments)]
        caught = [w for w in waits if w is not None]
        longest = max(caught, default=float("nan"))
        print(f"{name:25} {whole:8.1f} s   {len(caught)} of {moments} caught   longest wait {longest:.2f} s", flush=True)


if __name__ == "__main__":
    main()
