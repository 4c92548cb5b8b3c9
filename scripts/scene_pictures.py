"""Pictures of the built-in model on airborne scans: classes, terrain and footprints of buildings; for the documentation.

    python scripts/scene_pictures.py DATA OUT        # needs: pip install '.[viz]'

DATA/airborne holds the scenes named below. Writes scenes.png, dtm.png and footprints.png to the folder OUT, and prints
the size of each. scenes.png has every scene, with the classes that the model gives it, drawn by scansion.render; noise is
not drawn. Terrain and footprints are made from these classes too, not from those in the files.
"""

import pathlib
import sys
import tempfile

import matplotlib
import numpy as np
import scansion
from matplotlib import pyplot as plt
from matplotlib.colors import LightSource
from PIL import Image
from scansion import terrain

matplotlib.use("Agg")

#: Caption, and the direction and the elevation of the oblique view, degrees; without these a map.
SCENES = {
    "lidarhd_housing.laz": ("Housing estate", 0, 45),
    "ahn3_delft_west.laz": ("AHN3, Delft", 45, 45),
    "lidarhd_sparse_1km.laz": ("Square kilometre, town", None, None),
    "lidarhd_building.laz": ("House in the mountains", 20, 40),
    "lidarhd_forest_edge.laz": ("Forest edge", 45, 40),
    "lidarhd_rural_sparse_1km.laz": ("Square kilometre, country", None, None),
    "lidarhd_farm_rgb.laz": ("Farm", 60, 50),
    "powerline_corridor.laz": ("Power line corridor", 20, 50),
    "lidarhd_fields_rgbnir_extra_bytes.laz": ("Fields", None, None),
    "b9_partial_labels_rgb.ply": ("Small town", 30, 45),
}
#: The scenes whose terrain and footprints are drawn.
MAPPED = ["ahn3_delft_west.laz", "lidarhd_housing.laz"]
#: Pictures in a row of the sheet, and pixels of one.
ROW, WIDTH, HEIGHT = 3, 600, 480
#: Low and high noise.
NOISE = (7, 18)
#: Edge of a cell of the terrain model, metres.
CELL = 0.5
#: Pixels of the width of a terrain model, and pixels an inch, which is the size of the text.
PLOT, DPI = 720, 150


def classified(path, model):
    """The cloud, with the classes of the model."""
    cloud = scansion.read(path)
    cloud["Classification"] = np.asarray(model.classify(cloud).codes).astype(np.uint8)
    return cloud


def tile(cloud, caption, azimuth, elevation):
    """Picture of a scene below its caption."""
    drawn = cloud[~np.isin(cloud["Classification"], NOISE)]
    size = {"width": WIDTH, "height": HEIGHT, "legend": False, "title": caption}
    if azimuth is None:
        return scansion.render(drawn, view="map", **size)
    return scansion.render(drawn, view="oblique", azimuth=azimuth, elevation=elevation, **size)


def save(pixels, path, count=256):
    """A PNG of so many colours, which is much smaller than one of all."""
    colours = Image.fromarray(pixels).quantize(count, kmeans=3, dither=Image.Dither.NONE)
    colours.save(path, optimize=True)
    print(f"{path.name}: {colours.width} x {colours.height} pixels, {path.stat().st_size / 1e3:,.0f} kB", flush=True)


def sheet(tiles):
    """The pictures in rows."""
    blank = np.full_like(tiles[0], tiles[0][0, 0])
    tiles = tiles + [blank] * (-len(tiles) % ROW)
    return np.vstack([np.hstack(tiles[i : i + ROW]) for i in range(0, len(tiles), ROW)])


def axes_of(clouds):
    """A figure with a plot of the same width for each cloud; the plots, each with room for a title and a scale bar."""
    sizes = [np.ptp(np.asarray(cloud.xyz)[:, :2], axis=0) for cloud in clouds]
    # In inches: width of a plot, the gap between two, and the room above and below.
    width, gap, room = PLOT / DPI, 0.15, 0.35
    heights = [width * high / wide for wide, high in sizes]
    size = (len(clouds) * width + (len(clouds) + 1) * gap, max(heights) + 2 * room)
    figure = plt.figure(figsize=size, dpi=DPI, facecolor="#fbfbf9")
    axes = []
    for i, high in enumerate(heights):
        box = (gap + i * (width + gap), size[1] - room - high, width, high)
        axes.append(figure.add_axes([at / size[k % 2] for k, at in enumerate(box)]))
        axes[-1].set_axis_off()
    return figure, axes


def label(ax, cloud, title):
    """The title, and a bar of 20 m below the south-west corner; the axes end where the cloud does."""
    (west, south), (east, north) = (f(np.asarray(cloud.xyz)[:, :2], axis=0) for f in (np.min, np.max))
    ax.set(xlim=(west, east), ylim=(south, north))
    ax.set_title(title, loc="left", fontsize=10, y=1.0)
    below = south - 0.025 * (east - west)
    ax.plot([west, west + 20], [below, below], color="black", linewidth=2, clip_on=False, solid_capstyle="butt")
    ax.text(west + 22, below, "20 m", va="center", fontsize=8)


def finished(figure):
    """The pixels of a figure."""
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()
    plt.close(figure)
    return pixels


def extent(raster):
    """West, east, south and north of a raster."""
    rows, columns = raster.values.shape
    west, north = raster.corner
    return west, west + columns * raster.cell, north - rows * raster.cell, north


def draw_terrain(clouds):
    """Terrain models, coloured by height and shaded; heights are exaggerated threefold in the shading."""
    figure, axes = axes_of(list(clouds.values()))
    for ax, (caption, cloud) in zip(axes, clouds.items(), strict=True):
        raster = terrain.dtm(cloud, cell=CELL)
        low, high = np.nanpercentile(raster.values, (1, 99))
        shade = LightSource(315, 45).hillshade(np.flipud(raster.values), vert_exag=3, dx=CELL, dy=CELL)
        colour = plt.get_cmap("terrain")(0.25 + 0.6 * np.clip((raster.values - low) / (high - low), 0, 1))[..., :3]
        ax.imshow(colour * (0.35 + 0.65 * np.flipud(shade)[..., None]), extent=extent(raster), interpolation="bilinear")
        label(ax, cloud, f"{caption}: {low:.1f} m (green) to {high:.1f} m (grey)")
    return finished(figure)


def rings(collection):
    """Every outer and inner ring of the footprints."""
    for feature in collection["features"]:
        shape = feature["geometry"]
        polygons = shape["coordinates"] if shape["type"] == "MultiPolygon" else [shape["coordinates"]]
        for polygon in polygons:
            yield from (np.asarray(ring)[:, :2] for ring in polygon)


def draw_footprints(clouds):
    """Outlines of the buildings over the points, which are lighter the higher they are."""
    figure, axes = axes_of(list(clouds.values()))
    for ax, (caption, cloud) in zip(axes, clouds.items(), strict=True):
        found = terrain.footprints(cloud)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "map.png"
            pixels = scansion.render(cloud, path, by="height", width=PLOT, legend=False)
            step, _, _, _, west, north = map(float, path.with_suffix(".pgw").read_text().split())
        # The world file has the centre of the first pixel.
        west, north = west - step / 2, north + step / 2
        box = (west, west + step * pixels.shape[1], north - step * pixels.shape[0], north)
        # Brighter, for the ground is dark.
        grey = (pixels.mean(axis=2) / 255) ** 0.7
        ax.imshow(grey, extent=box, cmap="gray", vmin=0, vmax=1)
        for ring in rings(found):
            ax.fill(*ring.T, facecolor="none", edgecolor="#e3120b", linewidth=1.2)
        label(ax, cloud, f"{caption}: {len(found['features'])} footprints")
    return finished(figure)


def main():
    data, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    model = scansion.PointClassifier.default()
    tiles, mapped = [], {}
    for name, (caption, azimuth, elevation) in SCENES.items():
        cloud = classified(data / "airborne" / name, model)
        tiles.append(tile(cloud, caption, azimuth, elevation))
        if name in MAPPED:
            mapped[name] = (caption, cloud)
    save(sheet(tiles), out / "scenes.png")
    mapped = dict(mapped[name] for name in MAPPED)
    save(draw_terrain(mapped), out / "dtm.png")
    save(draw_footprints(mapped), out / "footprints.png", count=48)


if __name__ == "__main__":
    main()
