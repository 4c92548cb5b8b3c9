from collections.abc import Callable
from typing import Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Blocks",
    "Boosting",
    "Cloud",
    "ContourStages",
    "Contours",
    "FileFormatError",
    "Forest",
    "HeightContours",
    "Lines",
    "Model",
    "ObjectModel",
    "ObjectTraining",
    "Objects",
    "Sites",
    "SyntheticScene",
    "__version__",
    "alpha_beta_swap",
    "alpha_expansion",
    "automatic_parameters",
    "baseline",
    "boundary_scores",
    "check_segment_options",
    "cluster_levels",
    "cluster_table",
    "column_name",
    "confusion_matrix",
    "connected_components",
    "contour_stages",
    "contours",
    "convert",
    "cut_pursuit",
    "diff",
    "edge_labels",
    "energy",
    "feature_columns",
    "feature_definitions",
    "feature_names",
    "feature_preset",
    "felzenszwalb",
    "filter",
    "fit_bagging",
    "fit_boosting",
    "fit_forest",
    "follow",
    "footprints",
    "ground_points",
    "has_strength",
    "height_above_ground",
    "height_contours",
    "heights",
    "icm",
    "inside_polygon",
    "inspect",
    "knn",
    "knn_graph",
    "load_xyz",
    "local_smoothing",
    "mapped_code",
    "mapped_codes",
    "merge",
    "merge_regions",
    "minimum_spanning_tree",
    "multiscale",
    "normals",
    "object_features",
    "object_preset",
    "octree_region_growing",
    "one_vs_rest",
    "optimal",
    "partition",
    "permutation_importance",
    "picked_labels",
    "polygon_text",
    "purities",
    "radius_features",
    "radius_names",
    "radius_outliers",
    "read",
    "read_idx",
    "read_off",
    "recipe_columns",
    "region_growing",
    "regularize",
    "render",
    "report",
    "rewrite",
    "riemannian",
    "road_points",
    "road_position",
    "run",
    "salvage",
    "sample_surface",
    "score_lines",
    "score_points",
    "scores",
    "search",
    "segment",
    "segment_colours",
    "segment_columns",
    "segment_graph",
    "segment_shapes",
    "segmentation_error",
    "settings_text",
    "sparse_convolution",
    "sparse_gradient",
    "spatial_folds",
    "spread_labels",
    "statistical_outliers",
    "statistics",
    "submanifold_convolution",
    "submanifold_gradient",
    "suggest",
    "supervoxels",
    "synthetic_scene",
    "terrain_raster",
    "within",
    "write",
    "write_footprints",
    "write_raster",
]

__version__: Final[str]

class FileFormatError(ValueError): ...

@final
class Cloud:
    @staticmethod
    def from_xyz(xyz: NDArray[np.float64]) -> Cloud: ...
    @staticmethod
    def from_ticks(
        ticks: NDArray[np.int32], scale: tuple[float, ...], offset: tuple[float, ...]
    ) -> Cloud: ...
    def __len__(self) -> int: ...
    def copy(self) -> Cloud: ...
    def xyz(self) -> NDArray[np.float64]: ...
    def axis(self, axis: int) -> NDArray[np.float64]: ...
    def ticks(self) -> tuple[NDArray[np.int32], list[float], list[float]] | None: ...
    def select(self, indices: NDArray[np.uint32]) -> Cloud: ...
    def columns(self) -> list[str]: ...
    def column(self, name: str) -> NDArray[Any] | None: ...
    def set_column(self, name: str, array: NDArray[Any]) -> None: ...
    def update_column(self, name: str, array: NDArray[Any]) -> None: ...
    def remove_column(self, name: str) -> bool: ...
    crs: str | None
    metres_per_unit: float | None
    def las_frame(self) -> tuple[list[float], list[float]]: ...
    def wkt(self) -> str | None: ...
    def las_wkt(self) -> str | None: ...
    def take_las_records(self, records: list[tuple[int, bytes]], wkt: bool) -> None: ...
    scheme: str
    class_names: dict[int, str]
    def unlabelled(self) -> list[int]: ...

@final
class Forest:
    @staticmethod
    def from_bytes(data: bytes) -> Forest: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def predict_proba(self, table: NDArray[np.float32], n_jobs: int | None = None) -> NDArray[np.float32]: ...
    def predict(self, table: NDArray[np.float32], n_jobs: int | None = None) -> NDArray[np.uint16]: ...
    def importance(self) -> NDArray[np.float64]: ...

@final
class Boosting:
    @staticmethod
    def from_bytes(data: bytes) -> Boosting: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def predict_proba(self, table: NDArray[np.float32], n_jobs: int | None = None) -> NDArray[np.float32]: ...
    def predict(self, table: NDArray[np.float32], n_jobs: int | None = None) -> NDArray[np.uint16]: ...
    def importance(self) -> NDArray[np.float64]: ...

@final
class Model:
    @staticmethod
    def train(
        clouds: list[Cloud],
        recipe: str,
        settings: list[str],
        dimension: str,
        map: str,
        unlabelled: bytes | None = None,
        names: list[str] = ...,
        strengths: list[float] = ...,
        elevation_model: str | None = None,
        checkpoint: str | None = None,
        n_jobs: int | None = None,
    ) -> tuple[Model, str]: ...
    def with_cars(
        self,
        clouds: list[Cloud],
        dimension: str,
        map: str,
        code: int,
        unlabelled: bytes | None = None,
        n_jobs: int | None = None,
    ) -> tuple[Model, str]: ...
    @staticmethod
    def default() -> Model: ...
    @staticmethod
    def load(path: str) -> Model: ...
    @staticmethod
    def from_bytes(data: bytes) -> Model: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def save(self, path: str) -> None: ...
    def classify(
        self,
        cloud: Cloud,
        probabilities: bool = False,
        regularize: str | None = None,
        metres_per_unit: float | None = None,
        elevation_model: str | None = None,
        abstain: float | None = None,
        divided: bool = True,
        settings: list[str] = ...,
        n_jobs: int | None = None,
    ) -> tuple[
        NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32] | None, list[str]
    ]: ...
    def codes(self) -> list[int]: ...
    def class_names(self) -> list[str]: ...
    def feature_names(self) -> list[str]: ...
    def recipe(self) -> str: ...
    def importance(self) -> NDArray[np.float64]: ...

_Bounds = tuple[tuple[float, float, float], tuple[float, float, float]]
_Part = tuple[list[str] | None, _Bounds | None, float | None, list[str]]

@final
class Blocks:
    def __new__(cls, path: str, size: int, part: _Part = ..., n_jobs: int | None = None) -> Blocks: ...
    def __iter__(self) -> Blocks: ...
    def __next__(self) -> Cloud: ...

def read(path: str, part: _Part = ..., n_jobs: int | None = None) -> Cloud: ...
def statistics(path: str, n_jobs: int | None = None) -> str: ...
def write(
    path: str, cloud: Cloud, scale: tuple[float, float, float] | None = None, n_jobs: int | None = None
) -> None: ...
def rewrite(
    input: str,
    output: str,
    edits: tuple[NDArray[np.uint8] | None, list[tuple[str, NDArray[Any]]]] = ...,
    keep: NDArray[np.bool_] | None = None,
    scale: tuple[float, float, float] | None = None,
    n_jobs: int | None = None,
) -> list[str]: ...
def settings_text(path: str) -> str: ...
def inspect(path: str) -> str: ...
def diff(a: str, b: str, n_jobs: int | None = None) -> str: ...
def convert(
    input: str,
    output: str,
    point_format: int | None = None,
    part: tuple[_Bounds | None, float | None] = ...,
    scale: tuple[float, float, float] | None = None,
    n_jobs: int | None = None,
) -> list[str]: ...
def merge(
    inputs: list[str],
    output: str,
    scale: tuple[float, float, float] | None = None,
    n_jobs: int | None = None,
) -> list[str]: ...
def salvage(input: str, output: str | None = None, n_jobs: int | None = None) -> str: ...
def segment(
    cloud: Cloud,
    recipe: str,
    settings: list[str],
    aim: str,
    size: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], list[NDArray[np.uint32]], str]: ...
def column_name(name: str) -> str: ...
def has_strength(method: str) -> bool: ...
def check_segment_options(recipe: str, settings: list[str], cutoff: bool, k_min: bool) -> None: ...
def segment_columns(recipe: str, settings: list[str]) -> list[str]: ...
def picked_labels(
    cloud: Cloud, files: list[str], within: float, unit: float | None = None, n_jobs: int | None = None
) -> NDArray[np.int16]: ...
def spread_labels(labels: NDArray[np.int16], segments: NDArray[Any]) -> NDArray[np.int16]: ...
def segment_colours(segments: NDArray[np.uint32]) -> NDArray[np.uint8]: ...
def follow(follower: Callable[[str, int, int], Any] | None = None) -> Callable[[str, int, int], Any] | None: ...
def spatial_folds(
    cloud: Cloud, folds: int, block: float | None = None, metres_per_unit: float | None = None
) -> NDArray[np.uint32]: ...
def permutation_importance(
    forest: Forest,
    table: NDArray[np.float32],
    labels: NDArray[np.uint16],
    weights: NDArray[np.float32] | None,
    repeats: int,
    seed: int,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def road_position(
    cloud: Cloud,
    road: NDArray[np.bool_],
    settings: str,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], float, float]: ...
def road_points(
    table: NDArray[np.float32], labels: NDArray[np.int16], trees: int, seed: int, n_jobs: int | None = None
) -> NDArray[np.bool_]: ...
def suggest(
    cloud: Cloud,
    recipe: str,
    settings: list[str],
    aim: str,
    wishes: str,
    size: float | None = None,
    doubt: NDArray[np.float32] | None = None,
    labelled: bool = False,
    page: tuple[str, str] | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], str]: ...
def multiscale(cloud: Cloud, settings: str, n_jobs: int | None = None) -> NDArray[np.float32]: ...
def feature_names(settings: str, first_scale: float) -> list[str]: ...
def feature_columns(settings: str) -> list[str]: ...
def feature_definitions() -> str: ...
def feature_preset(name: str) -> str: ...
def radius_features(
    cloud: Cloud,
    names: list[str],
    settings: str,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.float32]: ...
def radius_names() -> list[str]: ...
def automatic_parameters(
    cloud: Cloud, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> str: ...
def cluster_levels(
    cloud: Cloud, settings: str, colour: bool, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32], str]: ...
def cluster_table(
    cloud: Cloud, settings: str, n_jobs: int | None = None
) -> tuple[NDArray[np.float32], list[str], str]: ...
def fit_bagging(
    table: NDArray[np.float32],
    labels: NDArray[np.uint16],
    weights: NDArray[np.float32] | None,
    classes: int,
    params: str,
    oob_score: bool = False,
    n_jobs: int | None = None,
) -> tuple[Forest, float | None]: ...
def fit_boosting(
    table: NDArray[np.float32],
    labels: NDArray[np.uint16],
    weights: NDArray[np.float32] | None,
    classes: int,
    params: str,
    n_jobs: int | None = None,
) -> tuple[Boosting, NDArray[np.float64], NDArray[np.float64], int]: ...
def fit_forest(
    table: NDArray[np.float32],
    labels: NDArray[np.uint16],
    weights: NDArray[np.float32] | None,
    classes: int,
    params: str,
    oob_score: bool = False,
    n_jobs: int | None = None,
) -> tuple[Forest, float | None]: ...
def mapped_code(map: str, code: int) -> int | None: ...
def mapped_codes(map: str) -> bytes: ...
def recipe_columns(recipe: str, settings: list[str]) -> list[str]: ...
def confusion_matrix(
    truth: NDArray[np.int16], predicted: NDArray[np.int16], names: list[str]
) -> tuple[NDArray[np.uint64], NDArray[np.uint8]]: ...
def scores(truth: NDArray[np.int16], predicted: NDArray[np.int16], names: list[str]) -> str: ...
def one_vs_rest(truth: NDArray[np.int16], predicted: NDArray[np.int16], names: list[str]) -> str: ...
def purities(labels: NDArray[np.uint32], truth: NDArray[np.int16]) -> NDArray[np.float64]: ...
def boundary_scores(
    edges: NDArray[np.uint32], labels: NDArray[np.uint32], truth: NDArray[np.int16], hops: int
) -> str: ...
def segment_graph(
    edges: NDArray[np.uint32],
    labels: NDArray[np.uint32],
    weights: NDArray[np.float32] | None = None,
    weighted: bool = False,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]: ...
def segment_shapes(cloud: Cloud, labels: NDArray[np.uint32]) -> tuple[NDArray[np.uint64], NDArray[np.float64]]: ...
def search(
    clouds: list[Cloud],
    recipe: str,
    settings: list[str],
    grid: list[tuple[str, list[str]]],
    dimension: str,
    map: str,
    unlabelled: bytes | None = None,
    folds: int = 5,
    block: float | None = None,
    n_jobs: int | None = None,
) -> str: ...
def report(truth: NDArray[np.int16], predicted: NDArray[np.int16], names: list[str]) -> str: ...
def render(
    cloud: Cloud,
    settings: str,
    path: str | None = None,
    truth: NDArray[np.int16] | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.uint8]: ...
def run(arguments: list[str]) -> int: ...
def knn_graph(
    cloud: Cloud, k: int, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]: ...
def connected_components(nodes: int, edges: NDArray[np.uint32]) -> tuple[NDArray[np.uint32], int]: ...
def minimum_spanning_tree(
    nodes: int, edges: NDArray[np.uint32], weights: NDArray[np.float32] | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]: ...
def knn(
    cloud: Cloud, k: int, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]: ...
def within(
    cloud: Cloud,
    queries: Cloud | None,
    radius: float,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]: ...
def optimal(
    cloud: Cloud, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]: ...

_Problem: TypeAlias = tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None]
_Found: TypeAlias = tuple[NDArray[np.uint16], float, bool]

def alpha_expansion(problem: _Problem, settings: str, n_jobs: int | None = None) -> _Found: ...
def alpha_beta_swap(problem: _Problem, settings: str, n_jobs: int | None = None) -> _Found: ...
def icm(problem: _Problem, settings: str) -> _Found: ...
def energy(problem: _Problem, labels: NDArray[np.uint16], settings: str) -> float: ...
def regularize(
    cloud: Cloud,
    probabilities: NDArray[np.float32],
    settings: list[str],
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint16], NDArray[np.float32], float | None]: ...
def local_smoothing(problem: _Problem, n_jobs: int | None = None) -> NDArray[np.float32]: ...

_Valued: TypeAlias = tuple[
    NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None, NDArray[np.float32] | None
]
_Segments: TypeAlias = tuple[NDArray[np.uint32], NDArray[np.float64], float]

def cut_pursuit(valued: _Valued, settings: str, n_jobs: int | None = None) -> _Segments: ...
def merge_regions(valued: _Valued, settings: str) -> _Segments: ...
def partition(
    valued: _Valued,
    settings: str,
    cloud: Cloud | None = None,
    labels: NDArray[np.int16] | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], float, str]: ...
def normals(
    cloud: Cloud, k: int, orientation: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
def felzenszwalb(
    nodes: int, edges: NDArray[np.uint32], weights: NDArray[np.float32], settings: str
) -> tuple[NDArray[np.uint32], int]: ...
def supervoxels(
    cloud: Cloud,
    method: str,
    settings: str,
    normals: NDArray[np.float32] | None = None,
    colours: NDArray[np.float32] | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.uint32]: ...
def riemannian(
    cloud: Cloud, settings: str, n_jobs: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], str]: ...
def region_growing(
    cloud: Cloud, neighbours: int, settings: str, n_jobs: int | None = None
) -> NDArray[np.uint32]: ...
def octree_region_growing(cloud: Cloud, settings: str, n_jobs: int | None = None) -> NDArray[np.uint32]: ...
def object_features(
    cloud: Cloud,
    labels: NDArray[np.uint32],
    colours: NDArray[np.float32] | None = None,
    heights: NDArray[np.float32] | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], list[str]]: ...
def ground_points(
    cloud: Cloud, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> NDArray[np.bool_]: ...
def heights(
    cloud: Cloud,
    ground: NDArray[np.bool_],
    settings: str,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.float32]: ...
def terrain_raster(
    cloud: Cloud, product: str, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.float64], list[float], float, str]: ...
def height_above_ground(
    cloud: Cloud, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.float32], str]: ...
def footprints(
    cloud: Cloud, settings: str, shape: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> str: ...
def write_footprints(path: str, text: str) -> None: ...
def write_raster(
    path: str,
    values: NDArray[np.float64],
    corner: tuple[float, ...],
    cell: float,
    crs: str | None = None,
    metres_per_unit: float | None = None,
) -> None: ...
def height_contours(
    values: NDArray[np.float64],
    corner: tuple[float, ...],
    cell: float,
    settings: str,
    crs: str | None = None,
    metres_per_unit: float | None = None,
) -> HeightContours: ...
def segmentation_error(
    cloud: Cloud, labels: NDArray[np.uint32], truth: NDArray[np.int16], settings: str
) -> str: ...
def statistical_outliers(
    cloud: Cloud, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> NDArray[np.bool_]: ...
def radius_outliers(
    cloud: Cloud, settings: str, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> NDArray[np.bool_]: ...
def inside_polygon(cloud: Cloud, polygon: str, n_jobs: int | None = None) -> NDArray[np.bool_]: ...
def polygon_text(polygon: str) -> str: ...
def filter(
    input: str,
    output: str,
    settings: str,
    bounds: _Bounds | None = None,
    scale: tuple[float, float, float] | None = None,
    n_jobs: int | None = None,
) -> str: ...
def sparse_convolution(
    keys: NDArray[np.uint64],
    values: NDArray[np.float32],
    weights: NDArray[np.float32],
    bias: NDArray[np.float32],
    layer: str,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint64], NDArray[np.float32]]: ...
def sparse_gradient(
    keys: NDArray[np.uint64],
    values: NDArray[np.float32],
    weights: NDArray[np.float32],
    bias: NDArray[np.float32],
    gradient_keys: NDArray[np.uint64],
    gradient_values: NDArray[np.float32],
    layer: str,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]: ...
@final
class Contours:
    @staticmethod
    def restored(
        vertices: NDArray[np.float64], counts: NDArray[np.uint64], report: dict[str, Any], place: Cloud
    ) -> Contours: ...
    def place(self) -> Cloud: ...
    def vertices(self) -> tuple[NDArray[np.float64], NDArray[np.uint64]]: ...
    def report(self) -> str: ...
    def write(self, path: str, min_confidence: float) -> None: ...
@final
class HeightContours:
    @staticmethod
    def restored(
        vertices: NDArray[np.float64],
        counts: NDArray[np.uint64],
        lines: list[tuple[float, bool, bool]],
        crs: str | None,
        metres_per_unit: float | None,
    ) -> HeightContours: ...
    def rest(self) -> tuple[list[tuple[float, bool, bool]], str | None, float | None]: ...
    def vertices(self) -> tuple[NDArray[np.float64], NDArray[np.uint64]]: ...
    def heights(self) -> NDArray[np.float64]: ...
    def closed(self) -> NDArray[np.bool_]: ...
    def lengths(self) -> NDArray[np.float64]: ...
    def write(self, path: str) -> None: ...
@final
class Lines:
    def __new__(cls, vertices: NDArray[np.float64], counts: NDArray[np.uint64]) -> Lines: ...
@final
class SyntheticScene:
    def points(self) -> NDArray[np.float32]: ...
    def codes(self) -> NDArray[np.uint8]: ...
    def edges(self) -> NDArray[np.float32]: ...
    def edge_spacing(self) -> NDArray[np.float32]: ...
    def scan_positions(self) -> NDArray[np.float32]: ...

def contours(
    cloud: Cloud,
    model: Model | None,
    settings: str,
    codes: NDArray[np.uint8] | None,
    n_jobs: int | None = None,
) -> Contours: ...
@final
class ContourStages:
    @property
    def voxel(self) -> float: ...
    def lines(self, settings: list[str]) -> Contours: ...
    def candidates(self, reference: Lines, unsure: Lines) -> NDArray[np.float32]: ...

def contour_stages(
    cloud: Cloud, model: Model | None, settings: str, n_jobs: int | None = None
) -> ContourStages: ...
def baseline(
    cloud: Cloud, strengths: NDArray[np.float32], params: str, n_jobs: int | None = None
) -> Contours: ...
def synthetic_scene(kind: str, settings: str, n_jobs: int | None = None) -> SyntheticScene: ...
def score_lines(found: Lines, reference: Lines, unsure: Lines, params: str) -> str: ...
def score_points(
    points: NDArray[np.float64], found: NDArray[np.bool_], reference: NDArray[np.bool_], params: str
) -> str: ...
def edge_labels(cloud: Cloud, lines: Lines, voxel: float | None) -> NDArray[np.int16]: ...
@final
class Objects:
    @staticmethod
    def of_entries(
        shape: str, starts: list[int], places: NDArray[np.uint64], values: NDArray[np.float32], labels: list[int]
    ) -> Objects: ...
    @staticmethod
    def of_points(shape: str, starts: list[int], points: NDArray[np.float32], labels: list[int]) -> Objects: ...

@final
class ObjectTraining:
    def __new__(cls, network: str, learning: str, objects: Objects, classes: list[str]) -> ObjectTraining: ...
    def epoch(self, objects: Objects, n_jobs: int | None = None) -> str: ...
    def epochs(self) -> int: ...
    def model(self, labels: str, preset: str) -> ObjectModel: ...
    def save(self, path: str, objects: Objects) -> None: ...
    def resume(self, path: str, objects: Objects) -> None: ...

@final
class ObjectModel:
    @staticmethod
    def load(path: str) -> ObjectModel: ...
    def save(self, path: str) -> None: ...
    def about(self) -> str: ...
    def weights(self) -> dict[str, NDArray[np.float32]]: ...
    def predict_proba(self, objects: Objects, n_jobs: int | None = None) -> NDArray[np.float32]: ...

def object_preset(
    name: str, resolution: int, density: float | None = None, dense: bool = False, settings: list[str] = ...
) -> str: ...
def read_idx(path: str) -> NDArray[np.uint8]: ...
def load_xyz(folder: str) -> tuple[NDArray[np.float64], list[int], list[str]]: ...
def read_off(path: str) -> tuple[NDArray[np.float64], NDArray[np.uint32]]: ...
def sample_surface(
    vertices: NDArray[np.float64], triangles: NDArray[np.uint32], count: int, seed: int
) -> NDArray[np.float64]: ...
@final
class Sites:
    def __new__(cls, coordinates: NDArray[np.int64], n_jobs: int | None = None) -> Sites: ...
    def positions(self) -> NDArray[np.int64]: ...
    def __len__(self) -> int: ...
    @property
    def axes(self) -> int: ...
    @property
    def nbytes(self) -> int: ...

def submanifold_convolution(
    sites: Sites,
    features: NDArray[np.float32],
    weights: NDArray[np.float32],
    layer: str,
    n_jobs: int | None = None,
) -> NDArray[np.float32]: ...
def submanifold_gradient(
    sites: Sites,
    features: NDArray[np.float32],
    weights: NDArray[np.float32],
    gradient: NDArray[np.float32],
    layer: str,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
