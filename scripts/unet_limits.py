"""What limits the recipe `unet` on scenes unlike its training: data, capacity, cells, augmentation, steps; for docs/unet.md.

    python scripts/unet_limits.py DATA [PROGRAM] [SEEDS] [WORD ...]      # needs: pip install .

PROGRAM defaults to scansion, SEEDS to 1; with words, only the rows whose name has one of them. Scenes as the airborne ones of
scripts/unet.py. Each row changes one thing; scores are means over the seeds, without and with the random field on segments;
seconds are those of the processor for training.
"""

import pathlib
import sys
import tempfile

SEEDS = int(sys.argv[3]) if len(sys.argv) > 3 else 1
WORDS = sys.argv[4:]
sys.argv[3:] = []
from ladder import AIRBORNE, run, scores  # noqa: E402

HOUSING, AHN3 = AIRBORNE["train"]
DENSITIES = "training.densities=[4.0, 1.0]"
UNCHANGED = ["augment.turn=false", "augment.scale=0", "augment.noise=0", "augment.thin=1"]
#: Name, clouds of the training, settings beside cells of 0.5 m and thinned copies.
ROWS = [
    ("as in the table", [HOUSING, AHN3], []),
    ("data: housing estate only", [HOUSING], []),
    ("data: AHN3 only", [AHN3], []),
    ("data: no thinned copies", [HOUSING, AHN3], ["training.densities=[]"]),
    ("capacity: half of the channels", [HOUSING, AHN3], ["network.widths=[8, 16, 32, 48]"]),
    ("capacity: 1.5 times the channels", [HOUSING, AHN3], ["network.widths=[24, 48, 96, 144]"]),
    ("cells of 0.35 m", [HOUSING, AHN3], ["voxel=0.35"]),
    ("cells of 0.8 m", [HOUSING, AHN3], ["voxel=0.8"]),
    ("augmentation: none", [HOUSING, AHN3], UNCHANGED),
    ("augmentation: half of the parts mixed", [HOUSING, AHN3], ["augment.mix=0.5"]),
    ("inputs: returns too", [HOUSING, AHN3], ["inputs.returns=true"]),
    ("twice the parts", [HOUSING, AHN3], ["learning.parts=8"]),
    ("two views of each part, consistency 10", [HOUSING, AHN3], ["learning.consistency=10"]),
    ("300 steps", [HOUSING, AHN3], ["learning.steps=300"]),
    ("1200 steps", [HOUSING, AHN3], ["learning.steps=1200"]),
]


def labels(clouds):
    """The options for labels of these clouds, with those for AHN3 only if it is among them."""
    return AIRBORNE["labels"] if AHN3 in clouds else ["--map", "3-4=5", "--classes", "2,5,6"]


def measured(clouds, settings, folder):
    """Mean IoU without and with field of each seed, with the processor seconds of training."""
    rows = []
    for seed in range(SEEDS):
        model = folder / "any.model"
        sets = [word for setting in ["voxel=0.5", DENSITIES, *settings] for word in ("--set", setting)]
        used, _ = run("train", *clouds, "-o", model, "--recipe", "unet", "--seed", seed, *labels(clouds), *sets)
        rows.append([*(scores(AIRBORNE, model, method, folder)[2] for method in ("none", "segment-crf")), used])
    return rows


def main():
    print("| | mean IoU | with field | training, s |\n|---|---|---|---|", flush=True)
    for name, clouds, settings in ROWS:
        if WORDS and not any(word in name for word in WORDS):
            continue
        with tempfile.TemporaryDirectory() as folder:
            plain, field, seconds = (sum(column) / SEEDS for column in zip(*measured(clouds, settings, pathlib.Path(folder))))
        print(f"| {name} | {plain:.1f} | {field:.1f} | {seconds:.0f} |", flush=True)


if __name__ == "__main__":
    main()
