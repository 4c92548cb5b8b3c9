"""The network `unet` and the recipe `weak`, trained on the same few labels of a cloud; for docs/unet.md.

    python scripts/weak_unet.py DATA [PART] [SEEDS] [STEPS] [WORD ...]       # needs: pip install . ; defaults: part_14 3 800

The network is trained without views, with one view of twice as many parts, and with two views of each part (consistency); with
words, only the rows whose name has one of them. The labels are those of scripts/weak.py: 15 random points of each class. Scores
count the points without a label; seconds are those of the processor, summed over the threads.
"""

import pathlib
import sys
import time

import numpy as np
import scansion
from weak import STREET, load, pick

SCORES = ("overall_accuracy", "mean_f1_score", "mean_intersection_over_union")


def scored(model, xyz, codes, labels):
    """Overall accuracy, mean F1 and mean IoU without and with the field on segments, seconds of training."""
    start = time.process_time()
    model.fit(xyz, labels)
    seconds, row = time.process_time() - start, []
    counted = (codes > 0) & (labels < 0)
    for method in ("none", "segment-crf"):
        found = np.asarray(model.classify(xyz, regularize=method).codes)
        scores = scansion.evaluation.scores(codes[counted], found[counted])
        row += [100 * scores[key] for key in SCORES]
    return [*row, seconds]


def network(steps, seed, **learning):
    settings = {"recipe": "unet", "learning.steps": steps, **{f"learning.{key}": value for key, value in learning.items()}}
    return scansion.PointClassifier(settings, random_state=seed)


def main(data, part, seeds, steps, words):
    xyz, codes = load(data / f"oakland/{part}.laz", STREET)
    few = [pick(codes, 15, seed) for seed in range(seeds)]
    recipes = {
        "weak": lambda seed: scansion.WeakClassifier(random_state=seed),
        "unet, consistency 0": lambda seed: network(steps, seed, consistency=0),
        "unet, consistency 0, twice the parts": lambda seed: network(steps, seed, consistency=0, parts=8),
        "unet, consistency 10": lambda seed: network(steps, seed, consistency=10),
    }
    print(f"{part}: {len(xyz):,} points, {(few[0] > 0).sum()} labels, {steps} steps")
    print(
        "| | OA | mean F1 | mean IoU | with field: OA | mean F1 | mean IoU | training, s |\n" + "|---" * 8 + "|", flush=True
    )
    for name, recipe in recipes.items():
        if words and not any(word in name for word in words):
            continue
        rows = np.array([scored(recipe(seed), xyz, codes, labels) for seed, labels in enumerate(few)])
        cells = [f"{m:.1f} ± {s:.1f}" if seeds > 1 else f"{m:.1f}" for m, s in zip(rows.mean(axis=0), rows.std(axis=0))]
        print(f"| {name} | " + " | ".join([*cells[:-1], f"{rows[:, -1].mean():.0f}"]) + " |", flush=True)


if __name__ == "__main__":
    part, seeds, steps = [*sys.argv[2:5], *("part_14", "3", "800")[len(sys.argv[:5]) - 2 :]]
    main(pathlib.Path(sys.argv[1]), part, int(seeds), int(steps), sys.argv[5:])
