"""Our recipes beside OpenPointClass: accuracy with the same training clouds, and speed.

    python scripts/openpointclass.py DATA BIN [--scansion FILE] [--threads N]        # needs: pip install .

BIN is the folder with the programs pctrain and pcclassify of OpenPointClass; FILE is our program, `scansion` by default.
All learn from the housing estate and the western half of AHN3, classes ground, vegetation and building (2, 5, 6), and
label the eastern half, 10 m away, and scans of other flights. Seconds are those of whole processes, one at a time.
"""

import argparse
import os
import pathlib
import subprocess
import tempfile
import time

import numpy as np
import scansion

CLASSES = (2, 5, 6)
RETURNS = ["ReturnNumber", "NumberOfReturns"]
#: Metres between the halves of AHN3.
GAP = 10.0
SCENES = {
    "lidarhd_forest_edge.laz": "Forest edge",
    "lidarhd_building.laz": "House in the mountains",
    "lidarhd_farm_rgb.laz": "Farm (machine labels)",
    "lidarhd_rural_sparse_1km.laz": "Rural square kilometre",
}
FOOT = 0.3048


def codes_of(cloud, name):
    """Codes 2, 5 and 6; others 0."""
    codes = np.asarray(cloud["Classification"]).astype(int)
    codes = np.where(np.isin(codes, (3, 4) if "ahn3" not in name else (1,)), 5, codes)
    return np.where(np.isin(codes, CLASSES), codes, 0).astype(np.uint8)


def write_ply(path, xyz, codes):
    """As OpenPointClass reads it: 32-bit coordinates above 0 and colours, here black."""
    fields = [(axis, "<f4") for axis in "xyz"] + [(colour, "u1") for colour in ("red", "green", "blue")]
    rows = np.zeros(len(xyz), [*fields, ("classification", "u1")])
    for axis, values in zip("xyz", (xyz - np.floor(xyz.min(0))).T, strict=True):
        rows[axis] = values
    rows["classification"] = codes
    kinds = {"<f4": "float", "|u1": "uchar"}
    lines = [f"property {kinds[rows.dtype[name].str]} {name}" for name in rows.dtype.names]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}", *lines, "end_header", ""]
    path.write_bytes("\n".join(header).encode() + rows.tobytes())


def read_ply(path):
    """The classes of a binary PLY of floats and bytes."""
    header, _, rows = path.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in header.decode().splitlines()]
    kinds = {"float": "<f4", "uchar": "u1"}
    fields = [(line[2], kinds[line[1]]) for line in words if line[0] == "property"]
    return np.frombuffer(rows, fields)["classification"]


class Scene:
    """A cloud as files for both programs."""

    def __init__(self, folder, title, cloud, codes):
        self.title, self.codes = title, codes
        stem = title.replace(" ", "_").replace("(", "").replace(")", "")
        self.laz, self.ply = folder / f"{stem}_cloud.laz", folder / f"{stem}_cloud.ply"
        columns = {name: np.asarray(cloud[name]) for name in RETURNS if name in cloud}
        scansion.write(self.laz, scansion.PointCloud(cloud.xyz, Classification=codes, **columns))
        write_ply(self.ply, cloud.xyz, codes)

    def ious(self, found):
        found = np.where(np.isin(found, (3, 4)), 5, found)[self.codes > 0]
        codes = self.codes[self.codes > 0]
        both = [100 * ((found == c) & (codes == c)).sum() / ((found == c) | (codes == c)).sum() for c in CLASSES]
        return f"{np.mean(both):.1f} ({' '.join(f'{iou:.0f}' for iou in both)})"


def scenes(data, folder):
    """The training clouds and the others."""
    housing = scansion.read(data / "airborne/lidarhd_housing.laz", columns=["Classification", *RETURNS])
    ahn = scansion.read(data / "airborne/ahn3_delft_west.laz", columns=["Classification", *RETURNS])
    x, codes = ahn.xyz[:, 0], codes_of(ahn, "ahn3")
    middle = np.median(x)
    west, east = x < middle, x >= middle + GAP
    training = [
        Scene(folder, "Housing estate", housing, codes_of(housing, "housing")),
        Scene(folder, "AHN3 west", ahn.select(west), codes[west]),
    ]
    others = [Scene(folder, "AHN3, the half beside", ahn.select(east), codes[east])]
    for name, title in SCENES.items():
        cloud = scansion.read(data / "airborne" / name, columns=["Classification", *RETURNS])
        others.append(Scene(folder, title, cloud, codes_of(cloud, name)))
    return training, others


def autzen(data, folder):
    """A square with a million points in the middle of Autzen, in metres."""
    xyz = scansion.read(data / "scale/autzen_10M.laz", columns=[]).xyz * FOOT
    far = np.abs(xyz - np.median(xyz, axis=0))[:, :2].max(1)
    nearest = np.argpartition(far, 1_000_000)[:1_000_000]
    cloud = scansion.PointCloud(xyz[np.sort(nearest)])
    return Scene(folder, "Autzen", cloud, np.zeros(len(cloud), np.uint8))


class Timed:
    """Runs programs and keeps the seconds."""

    def __init__(self, threads):
        self.environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}

    def __call__(self, *words):
        start = time.perf_counter()
        subprocess.run([str(w) for w in words], check=True, env=self.environment, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--scansion", default="scansion")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    timed, threads = Timed(options.threads), f"-j{options.threads}"
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        training, others = scenes(options.data, folder)
        wide = autzen(options.data, folder)
        files = [scene.ply for scene in training]
        theirs = {"seconds": timed(options.bin / "pctrain", *files, "-o", folder / "theirs.bin", "--classes", "2,5,6")}
        theirs["model"] = folder / "theirs.bin"
        ways = {"OpenPointClass": ["-r", "none"], "the same, smoothed (its default)": []}
        rows = {way: dict(theirs, options=more, theirs=True) for way, more in ways.items()}
        for recipe in ("pyramid", "airborne"):
            model = folder / f"{recipe}.model"
            words = [options.scansion, "train", *(scene.laz for scene in training), "--classes", "2,5,6"]
            seconds = timed(*words, "--recipe", recipe, "-o", model, "--quiet", threads)
            own = {"seconds": seconds, "model": model, "theirs": False}
            if recipe == "pyramid":
                rows["recipe `pyramid`, `--regularize none`"] = {**own, "options": ["--regularize", "none"]}
            rows[f"recipe `{recipe}`"] = {**own, "options": []}
        titles = [scene.title for scene in others]
        print(f"| program | training, s | model, MB | {' | '.join(titles)} | 1 M points of Autzen, s |")
        print("|---|---|---|" + "---|" * (len(titles) + 1), flush=True)
        for way, row in rows.items():
            cells = []
            for scene in [*others, wide]:
                if row["theirs"]:
                    out = folder / "classified_cloud.ply"
                    seconds = timed(options.bin / "pcclassify", scene.ply, out, row["model"], *row["options"])
                else:
                    out = folder / "classified.laz"
                    words = [options.scansion, "classify", scene.laz, "-m", row["model"], "-o", out, "--overwrite"]
                    seconds = timed(*words, *row["options"], "--quiet", threads)
                if scene is wide:
                    cells.append(f"{seconds:.1f}")
                    continue
                found = read_ply(out) if row["theirs"] else scansion.read(out, columns=["Classification"])["Classification"]
                cells.append(scene.ious(np.asarray(found)))
            size = row["model"].stat().st_size / 1e6
            print(f"| {way} | {row['seconds']:.0f} | {size:.0f} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
