//! Recipes: the published methods from cloud to labels. Each has a folder whose `mod.rs` reads like the method section
//! of its paper; its parameters are saved as TOML. All methods implement [`System`].

mod auto_context;
mod builtin;
mod classify;
mod clusters;
mod contours;
mod labels;
mod model;
mod objects;
mod one_stage;
mod pyramid;
mod regularise;
mod search;
mod segment;
mod spheres;
mod suggest;
mod system;
mod trained;
mod training;
mod unet;
mod weak;
mod windows;

pub use auto_context::{AutoContextKind, AutoContextRecipe, AutoContextReport, CarReport, CarTraining, FoldParams};
pub use builtin::{BUILTIN_MAP, builtin_limits, builtin_misfit, default_contour_model, default_model, is_builtin};
pub use classify::rules::{CarParams, ClassRules, DeckParams, LevelParams, WaterParams, WireParams};
pub use classify::statistics::CloudStatistics;
pub use classify::{Classified, ClassifyParams, FeatureFit, Job};
pub use clusters::{ClusterSet, ClusterTable, ClusterTableParams, ClustersKind, ClustersRecipe, cluster_table};
pub use contours::{
    Baseline, BaselineParams, CandidateTraining, ContourLine, ContourParams, ContourStages, Contours, ContoursKind,
    ContoursRecipe, ContoursReport, SceneScores, baseline_contours, edge_labels, labelled_scene, labelled_scenes,
    measure_scene,
};
pub use labels::file::{LabelFile, PickedCloud, Picking};
pub use labels::{EdgeLines, LabelParams, LabelledCloud, Labels, read_labels};
pub use model::any::{AnyFitted, AnyRecipe};
pub use model::{Model, classify, contour_stages, contours, statistics};
pub use objects::{Heights, ObjectSegments, ObjectTraining, ObjectsKind, ObjectsRecipe, ObjectsReport, SupervoxelMode};
pub use one_stage::OneStageReport;
pub use pyramid::{DepthScore, PyramidKind, PyramidRecipe, PyramidReport};
pub use regularise::{
    ChoiceParams, ClassDimension, Posterior, Probabilities, Regularise, RegulariseParams, Regularised,
    RegularisedCloud, regularise, regularise_cloud,
};
pub use search::{Grid, GridAxis, SearchParams, SearchReport, SearchScore, search};
pub use segment::{
    ClusterReport, GrowingParams, LevelReport, SegmentMethod, SegmentParams, SegmentReport, Segmented, segment,
};
pub use spheres::{SphereGroups, SpheresKind, SpheresRecipe};
pub use suggest::{Doubt, KnownPoints, SuggestParams, Suggestion, suggest, suggestion_page};
pub use system::report::{ClassCount, Report};
pub use system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
pub use trained::{EarlierStage, Trained};
pub use training::blocks::square_folds;
pub use training::choice::{CandidateScore, ChoiceReport};
pub use training::networks::NetworkReport;
pub use training::samples::TrainingParams;
pub use unet::{Augmentation, LearningParams, UNetInputs, UNetKind, UNetRecipe};
pub use weak::{
    ClassShares, Descriptors, Example, LabelledPosition, RoadExample, RoadParams, RoadSource, StrengthScore, WeakKind,
    WeakLabels, WeakLearned, WeakRecipe, WeakReport,
};
pub use windows::{Placement, WindowsKind, WindowsLearning, WindowsRecipe};
