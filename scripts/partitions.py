"""Every way to part a cloud at equal numbers of segments, on four sensors; writes docs/partitions.md.

    python scripts/partitions.py DATA    # needs: pip install .

Each method has one number that decides how many segments there are; it is searched until there are about as many as
asked for. Oracle: points that are right if every segment gets its commonest class. Boundary recall and precision: share
of edges between classes that a boundary of segments lies at (or one edge away), and the other way round.
"""

import pathlib
import sys
import time

import numpy as np
import scansion

SCENES = {
    "oakland/part_14.laz": ("mobile laser, street (Oakland part_14)", 1000, "Classification", 1.0),
    "airborne/lidarhd_housing.laz": ("airborne laser, housing (LiDAR HD)", 3000, "Classification", 1.0),
    "indoor/s3dis_office.ply": ("indoor, Matterport (S3DIS office)", 1000, "label", 0.2),
    "rgbd/pcl_data__learn0.pcd": ("RGB-D camera, table top (PCL)", 200, "Classification", 0.02),
}
METHODS = {
    "cut-pursuit": ("strength", 0.05),
    "merge": ("strength", 0.05),
    "riemannian": ("strength", 0.1),
    "local-graph": ("size", 1.2),
    "slic": ("size", 2.4),
    "vccs": ("size", 2.4),
    "region-growing": ("region_growing.min_size", 50.0),
    "octree-region-growing": ("size", 2.0),
}
TRIALS, CLOSE = 9, 0.08


def load(path, column):
    cloud = scansion.read(path)
    names = [name for name in cloud.columns if name.lower() == column.lower()]
    if not names:
        raise SystemExit(f"{path}: no column {column} among {', '.join(cloud.columns)}")
    code = np.asarray(cloud[names[0]]).astype(np.int64)
    kept = np.isfinite(cloud.xyz).all(1)
    _, code = np.unique(code, return_inverse=True)
    rgb = {n: np.asarray(cloud[n])[kept] for n in ("Red", "Green", "Blue") if n in cloud.columns}
    # Codes of 0 and 1 would say nothing.
    return scansion.PointCloud(cloud.xyz[kept], Classification=(code[kept] + 2).astype(np.uint8), **rgb)


def part(cloud, method, value, scale):
    key = METHODS[method][0]
    recipe = {"riemannian.octree.stop.sigma": 0.1 * scale} if method == "riemannian" else {}
    named = {}
    if key in ("strength", "size"):
        named[key] = value
    else:
        recipe[key] = round(value)
    if method == "octree-region-growing":
        recipe |= {f"octree_region_growing.{n}": v * scale for n, v in (("residual", 0.05), ("distance", 0.05))}
    return scansion.segment(cloud, method=method, recipe=recipe, **named).report


def search(cloud, method, wanted, scale):
    """The report whose number of segments is nearest to the wanted one: larger values give fewer segments."""
    value = METHODS[method][1] * (scale if METHODS[method][0] == "size" else 1.0)
    low = high = best = None
    for _ in range(TRIALS):
        start = time.time()
        report = part(cloud, method, value, scale)
        report["seconds"] = time.time() - start
        report["value"] = value
        miss = abs(np.log(report["segments"] / wanted))
        if best is None or miss < best[0]:
            best = (miss, report)
        if miss < CLOSE:
            break
        if report["segments"] > wanted:
            low = value
            value = np.sqrt(value * high) if high else 2 * value
        else:
            high = value
            value = np.sqrt(low * value) if low else value / 2
    return best[1]


HEAD = """# Ways to part a cloud, side by side

Written by `python scripts/partitions.py DATA` ({minutes:.0f} minutes). At about equal numbers of segments, found by one number of each
method: oracle is the share of points that are right if every segment gets its commonest class; recall and precision are those of the
boundaries between classes, to one edge of the graph of 10 neighbours. All else are defaults, lengths scaled to the scene. Seconds are
of the whole call on {cores} cores, busy or not.

"""


def main(data):
    start, text = time.time(), []
    for path, (title, wanted, column, scale) in SCENES.items():
        cloud = load(data / path, column)
        text += [
            f"## {title}: {len(cloud):,} points, about {wanted} segments\n",
            "| method | by | segments | oracle | boundary recall | precision | seconds |",
            "|---|---|---|---|---|---|---|",
        ]
        for method, (key, _) in METHODS.items():
            r = search(cloud, method, wanted, scale)
            b = r["boundaries"]
            text.append(
                f"| {method} | {key} {r['value']:.3g} | {r['segments']:,} | {100 * r['oracle_accuracy']:.2f} % | "
                f"{100 * b['recall']:.1f} % | {100 * b['precision']:.1f} % | {r['seconds']:.1f} |"
            )
            print(text[-1], flush=True)
        text.append("")
    import os

    page = pathlib.Path(__file__).parent.parent / "docs/partitions.md"
    tail = page.read_text(encoding="utf-8").partition("## What to take")[1:] if page.exists() else ("", "")
    head = HEAD.format(minutes=(time.time() - start) / 60, cores=os.cpu_count())
    page.write_text(head + "\n".join(text) + "\n" + "".join(tail), encoding="utf-8")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
