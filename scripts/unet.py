"""The recipe `unet` beside the forests at equal training data; writes the table of docs/unet.md.

    python scripts/unet.py DATA [PROGRAM] [SEEDS] [SCENE]      # needs: pip install .

PROGRAM defaults to scansion, SEEDS to 3; SCENE is streets or airborne, both by default.

Scenes as in ladder.py. Each recipe is trained with seeds 0, 1, ...; scores are means over the seeds, with the lowest and the
highest mean IoU. Seconds are those of the processor: for training, and for classifying all test scenes on one thread.
"""

import pathlib
import sys
import tempfile

SEEDS = int(sys.argv[3]) if len(sys.argv) > 3 else 3
ONLY = sys.argv[4:]
sys.argv[3:] = []
from ladder import AIRBORNE, STREETS, run, scores  # noqa: E402

#: Name of the row, recipe, settings for streets, settings for airborne scans.
RECIPES = [
    ("spheres, heights, forest", "spheres", ["groups.height=true"], ["groups.height=true"]),
    ("two stages with context", None, [], []),
    ("unet", "unet", [], ["voxel=0.5", "training.densities=[4.0, 1.0]"]),
]
#: The recipe of two stages, by scene.
CONTEXT = ["mobile", "airborne"]


def measured(scene, number, recipe, settings, folder):
    """Rows (without and with the random field on segments): scores of each seed, processor seconds of training, file size."""
    found = {"none": [], "segment-crf": []}
    for seed in range(SEEDS):
        model = folder / "any.model"
        sets = [word for setting in settings for word in ("--set", setting)]
        name = recipe or CONTEXT[number]
        used, _ = run("train", *scene["train"], "-o", model, "--recipe", name, "--seed", seed, *scene["labels"], *sets)
        for method, rows in found.items():
            rows.append([*scores(scene, model, method, folder), used, model.stat().st_size / 1e6])
    return found


def main():
    print("| | OA | mean F1 | mean IoU | lowest to highest | training, s | classify, s | memory, MB | file, MB |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    for number, (title, scene) in enumerate((("streets", STREETS), ("airborne", AIRBORNE))):
        if ONLY and title not in ONLY:
            continue
        for name, recipe, *settings in RECIPES:
            own = settings[number]
            if recipe == "spheres":
                own = [*scene["training"], *scene["spheres"], *own]
            with tempfile.TemporaryDirectory() as folder:
                found = measured(scene, number, recipe, own, pathlib.Path(folder))
            for method, rows in found.items():
                mean = [sum(column) / len(rows) for column in zip(*rows)]
                iou = [row[2] for row in rows]
                field = ", random field" if method == "segment-crf" else ""
                cells = [f"{mean[0]:.1f}", f"{mean[1]:.1f}", f"{mean[2]:.1f}", f"{min(iou):.1f} to {max(iou):.1f}"]
                cells += [f"{mean[5]:.0f}", f"{mean[3]:.0f}", f"{mean[4]:.0f}", f"{mean[6]:.1f}"]
                print(f"| {title}: {name}{field} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
