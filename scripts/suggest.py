"""Suggested segments against random points on the Oakland streets; writes docs/suggest-accuracy.md.

    python scripts/suggest.py DATA [SEEDS]    # needs: pip install .

A person who knows the truth answers two rounds of 30 suggestions of `scansion.suggest`: each segment gets the class of most
of its points. The second round is given the model and the labels of the first. For comparison, a model learns from 15
random points of each of the five classes, as in docs/weak-accuracy.md.
"""

import os
import pathlib
import sys
import time

import numpy as np
import scansion
from weak import STREET, load, pick

COUNT = 30
"""Suggestions a round."""


def mean_f1(code, found):
    """Mean F1 over the classes of the truth in percent; points of other classes are not counted."""
    known = code > 0
    code, found = code[known], found[known]
    shares = [2 * np.sum((code == c) & (found == c)) / (np.sum(code == c) + np.sum(found == c)) for c in np.unique(code)]
    return 100 * float(np.mean(shares))


def answered(asked, full, labels):
    """The labels after the suggested segments were given the class of most of their points, and these classes."""
    labels, classes = labels.copy(), []
    for segment in asked.segments:
        own = asked.cluster_id == segment["cluster_id"]
        classes.append(int(np.bincount(full[own]).argmax()))
        labels[own] = classes[-1]
    return labels, classes


def learned(xyz, labels, seed=0):
    return scansion.WeakClassifier(random_state=seed).fit(xyz, labels)


def rounds(xyz, code, full):
    """Mean F1 after one and two rounds, and the classes of all answers."""
    labels, classes = answered(scansion.suggest(xyz, COUNT), full, np.full(len(code), -1, np.int16))
    model = learned(xyz, labels)
    scores = [mean_f1(code, model.predict(xyz))]
    labels, more = answered(scansion.suggest(xyz, COUNT, model=model, labels=labels), full, labels)
    scores.append(mean_f1(code, learned(xyz, labels).predict(xyz)))
    return scores, classes + more


HEAD = """# Suggested segments against random points

Written by `python scripts/suggest.py DATA` ({seeds} seeds, {minutes:.0f} minutes on {cores} cores). Mean F1 in percent over the classes of
each cloud (2, 5, 6, 14, 15; all their points). Left: a model learns from 15 random points a class, which takes a person who
finds rare classes by eye. Right: the person names {count} segments that `scansion suggest` shows, and {count} more that it
shows when given the first model and labels; each segment gets the class of most of its points, the classes 1 (other) and 64
(vehicle) included. The last columns are the answers of both rounds. Method: [weak.md](weak.md#labels).

| cloud | 15 random points a class | {count} suggestions | {count} + {count} suggestions | ground | vegetation | facade | wire | pole | other |
|---|---|---|---|---|---|---|---|---|---|
"""


def main(data, seeds):
    start, text, every = time.time(), [], []
    for path in sorted((data / "oakland").glob("part_*.laz")):
        xyz, code = load(path, STREET)
        full = np.asarray(scansion.read(path, columns=["Classification"])["Classification"])
        random = [mean_f1(code, learned(xyz, pick(code, 15, seed), seed).predict(xyz)) for seed in range(seeds)]
        scores, classes = rounds(xyz, code, full)
        every.append([np.mean(random), *scores])
        counts = [classes.count(c) for c in STREET]
        cells = [f"{value:.1f}" for value in every[-1]] + [str(n) for n in [*counts, len(classes) - sum(counts)]]
        text.append(f"| {path.stem} | {' | '.join(cells)} |")
        print(text[-1], flush=True)
    text.append(f"| mean of the parts | {' | '.join(f'{value:.1f}' for value in np.mean(every, axis=0))} | | | | | | |")
    print(text[-1], flush=True)
    minutes = (time.time() - start) / 60
    head = HEAD.format(seeds=seeds, minutes=minutes, cores=os.cpu_count(), count=COUNT)
    page = pathlib.Path(__file__).parent.parent / "docs/suggest-accuracy.md"
    page.write_text(head + "\n".join(text) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 3)
