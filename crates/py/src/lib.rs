//! The Python package's native module `scansion._core`: registration only; one file for each module of the core.

mod annotation;
mod call;
mod classification;
mod cli;
mod cloud;
mod clusters;
mod contours;
mod convert;
mod error;
mod evaluation;
mod features;
mod filters;
mod graph;
mod height_contours;
mod images;
mod io;
mod json;
mod neighbours;
mod nn;
mod partitions;
mod progress;
mod recipes;
mod regularisation;
mod segmentation;
mod segments;
mod terrain;
mod words;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::annotation::{picked_labels, segment_colours, spread_labels};
    #[pymodule_export]
    use crate::classification::{Boosting, Forest, fit_bagging, fit_boosting, fit_forest, permutation_importance};
    #[pymodule_export]
    use crate::cli::run;
    #[pymodule_export]
    use crate::cloud::Cloud;
    #[pymodule_export]
    use crate::clusters::{automatic_parameters, cluster_levels, cluster_table};
    #[pymodule_export]
    use crate::contours::{
        ContourStages, Contours, Lines, SyntheticScene, baseline, contour_stages, contours, edge_labels, score_lines,
        score_points, synthetic_scene,
    };
    #[pymodule_export]
    use crate::error::FileFormatError;
    #[pymodule_export]
    use crate::evaluation::{boundary_scores, confusion_matrix, one_vs_rest, purities};
    #[pymodule_export]
    use crate::evaluation::{report, scores, segmentation_error};
    #[pymodule_export]
    use crate::features::{feature_columns, feature_definitions, feature_names, feature_preset, multiscale, normals};
    #[pymodule_export]
    use crate::features::{radius_features, radius_names};
    #[pymodule_export]
    use crate::filters::{filter, inside_polygon, polygon_text, radius_outliers, statistical_outliers};
    #[pymodule_export]
    use crate::graph::{connected_components, felzenszwalb, knn_graph, minimum_spanning_tree};
    #[pymodule_export]
    use crate::height_contours::{HeightContours, height_contours};
    #[pymodule_export]
    use crate::images::render;
    #[pymodule_export]
    use crate::io::{
        Blocks, column_name, convert, diff, inspect, merge, read, rewrite, salvage, settings_text, statistics, write,
    };
    #[pymodule_export]
    use crate::neighbours::{knn, optimal, within};
    #[pymodule_export]
    use crate::nn::{ObjectModel, ObjectTraining, Objects, object_preset};
    #[pymodule_export]
    use crate::nn::{Sites, sparse_convolution, sparse_gradient, submanifold_convolution, submanifold_gradient};
    #[pymodule_export]
    use crate::nn::{load_xyz, read_idx, read_off, sample_surface};
    #[pymodule_export]
    use crate::partitions::{object_features, octree_region_growing, region_growing, riemannian, supervoxels};
    #[pymodule_export]
    use crate::progress::follow;
    #[pymodule_export]
    use crate::recipes::{Model, mapped_code, mapped_codes, recipe_columns, search, spatial_folds};
    #[pymodule_export]
    use crate::regularisation::{
        alpha_beta_swap, alpha_expansion, energy, has_strength, icm, local_smoothing, regularize,
    };
    #[pymodule_export]
    use crate::segmentation::{cut_pursuit, merge_regions, partition, segment_graph, segment_shapes};
    #[pymodule_export]
    use crate::segments::{check_segment_options, segment, segment_columns, suggest};
    #[pymodule_export]
    use crate::terrain::{footprints, ground_points, height_above_ground, heights, road_points, road_position};
    #[pymodule_export]
    use crate::terrain::{terrain_raster, write_footprints, write_raster};

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
