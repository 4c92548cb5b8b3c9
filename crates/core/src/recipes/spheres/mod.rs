//! The recipe `spheres`: features in spheres of several radii and a random forest, or another classifier.
//!
//! H. Thomas, F. Goulette, J.-E. Deschaud, B. Marcotegui, Y. Le Gall, *Semantic classification of 3D point clouds with
//! multiscale spherical neighborhoods*, 3DV 2018, doi:10.1109/3DV.2018.00052. `docs/spheres.md` has the features and our
//! deviations.

use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::one_stage::{Description, OneStage, OneStageReport, classify, train};
use super::regularise::{Regularise, RegulariseParams};
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::classifiers::offers_classifiers;
use super::training::samples::TrainingParams;
use crate::classification::{
    BaggingParams, BoostingParams, ClassifierKind, ClassifierParams, ForestParams, LinearParams,
};
use crate::cloud::{MetricCloud, names};
use crate::error::Result;
use crate::features::definition::{Feature, Group};
use crate::features::{FeatureTable, SphereParams, Spheres, colours};
use crate::parallel::Monitor;
use crate::segmentation::{ClusterForm, ClusterInput, ClusterParams, cluster_levels};
use crate::terrain::{HeightParams, filtered_heights};
use crate::voxels::{Grid, sorted};
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpheresKind {
    /// Thomas et al. 2018.
    #[default]
    Spheres,
}

/// Features beside those of the spheres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SphereGroups {
    /// Red, green and blue of the point; the cloud needs the columns.
    pub colour: bool,
    /// Height above the ground.
    pub height: bool,
    /// The clusters of the point on four levels, by their shapes (recipe `clusters`).
    pub clusters: bool,
}

/// The parameters of the recipe `spheres`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpheresRecipe {
    /// Always `spheres`.
    pub recipe: SpheresKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// The classifier: `rf` (the paper's), `gbt` or `bagging`; each has its own section of parameters.
    pub classifier: ClassifierKind,
    /// The spheres.
    pub spheres: SphereParams,
    /// Features beside those of the spheres.
    pub groups: SphereGroups,
    /// The ground, for heights above it.
    pub ground: HeightParams,
    /// The clusters.
    pub clusters: ClusterParams,
    /// Selection of the training points.
    pub training: TrainingParams,
    /// The forest (`rf`).
    pub forest: ForestParams,
    /// Gradient-boosted trees (`gbt`).
    pub boosting: BoostingParams,
    /// Bagging.
    pub bagging: BaggingParams,
    /// Multinomial logistic regression (`linear`).
    pub linear: LinearParams,
    /// Regularisation of the labels; none in the paper.
    pub regularise: RegulariseParams,
}

offers_classifiers!(SpheresRecipe);

impl OneStage for SpheresRecipe {
    fn training(&self) -> &TrainingParams {
        &self.training
    }

    fn classifier_params(&self) -> ClassifierParams {
        self.classifier()
    }

    fn describe(&self, scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Description> {
        let points = scene.some_points(monitor)?;
        let spheres = Spheres::new(&points, &self.spheres, monitor)?;
        // Points that follow each other share searches.
        let grid = Grid::new(&points, spheres.first_radius())?;
        let points = sorted(points, &grid, monitor)?;
        let SphereGroups { colour, height, clusters } = self.groups;
        let colours = if colour { Some(colours(scene.cloud, &points.frame.index, monitor)?) } else { None };
        let heights = match height || clusters {
            true => Some(filtered_heights(&points, &self.ground, monitor)?),
            false => None,
        };
        let mut parts = Vec::new();
        let mut found = format!("first radius {:.4} m", spheres.first_radius());
        if let Some(heights) = heights.as_ref().filter(|_| clusters) {
            let input = ClusterInput { points: &points.positions, heights: Some(heights), colours: colours.as_deref() };
            let levels = cluster_levels(&input, &self.clusters, monitor)?;
            parts.push(levels.features(ClusterForm::Descriptor, monitor)?);
            found = format!("{found}; clusters: {}", levels.automatic.reasons.join("; "));
        }
        if let Some(values) = heights.filter(|_| height) {
            parts.push(FeatureTable { names: vec![Feature::Elevation.definition().name.into()], values });
        }
        if let Some(colours) = colours {
            parts.push(FeatureTable { names: Group::Colour.names().collect(), values: colours.into_flattened() });
        }
        let table = parts.into_iter().reduce(|all, part| all.beside(&part)).unwrap_or_default();
        Ok(Description { points, spheres: Some(spheres), table, found })
    }

    fn settled(mut self, first: &Description) -> Self {
        let radius = first.spheres.as_ref().map(Spheres::first_radius);
        self.spheres.first_radius = self.spheres.first_radius.or(radius);
        self
    }
}

impl System for SpheresRecipe {
    const NAME: &'static str = "spheres";
    type Learned = Nothing;
    type Report = OneStageReport;

    fn validate(&self) -> Result<()> {
        self.spheres.validate()?;
        self.ground.validate()?;
        self.clusters.validate()?;
        self.training.validate()?;
        self.validate_classifiers()?;
        self.regularise.not_automatic(Self::NAME)?;
        self.regularise.validate()
    }

    fn shared(&self) -> SharedSettings<'_> {
        SharedSettings {
            seed: self.seed,
            regularise: &self.regularise,
            metres_per_unit: None,
            densities: &self.training.densities,
        }
    }

    fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    fn columns(&self) -> Vec<String> {
        let colours = if self.groups.colour { names::COLOUR.map(String::from).to_vec() } else { Vec::new() };
        [colours, self.training.columns()].concat()
    }

    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 120 } else { 250 }
    }

    fn learn(
        &self,
        clouds: &[LabelledCloud],
        _options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>> {
        train(self, clouds, monitor)
    }

    fn classify(fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
        classify(fitted, job, monitor)
    }
}
