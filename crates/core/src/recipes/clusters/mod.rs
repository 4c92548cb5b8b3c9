//! The recipe `clusters`: clusters at four levels, a few features in spheres, and a forest that needs little training.
//!
//! E. Grilli, F. Poux, F. Remondino, *Unsupervised object-based clustering in support of supervised point-based 3D point
//! cloud classification*, ISPRS Archives XLIII-B2-2021.
//! `docs/clusters.md` has the steps and our deviations.

mod sets;
mod table;

pub use sets::ClusterSet;
pub use table::{ClusterTable, ClusterTableParams, cluster_table};

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
use crate::parallel::Monitor;
use crate::segmentation::{ClusterForm, ClusterParams};
use crate::terrain::HeightParams;
use serde::{Deserialize, Serialize};
use table::table_of_points;

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClustersKind {
    /// Grilli et al. 2021.
    #[default]
    Clusters,
}

/// The parameters of the recipe `clusters`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClustersRecipe {
    /// Always `clusters`.
    pub recipe: ClustersKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// The features: `a` (the clusters), `b` (spheres and height), `c` (clusters, a few of the spheres, height).
    pub set: ClusterSet,
    /// The form of the clusters: `descriptor`, or `rank` as in the paper, which names places of one cloud and means
    /// little in another.
    pub form: ClusterForm,
    /// Whether red, green and blue are features too, and describe the categories; the cloud needs the columns.
    pub colour: bool,
    /// The classifier: `rf` (the paper's), `gbt` or `bagging`; each has its own section of parameters.
    pub classifier: ClassifierKind,
    /// The clusters.
    pub clusters: ClusterParams,
    /// The ground, for heights above it.
    pub ground: HeightParams,
    /// Selection of the training points.
    pub training: TrainingParams,
    /// The forest (`rf`): Breiman's, as in the paper.
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

impl Default for ClustersRecipe {
    fn default() -> Self {
        Self {
            recipe: ClustersKind::default(),
            seed: 0,
            set: ClusterSet::default(),
            form: ClusterForm::Descriptor,
            colour: false,
            classifier: ClassifierKind::default(),
            clusters: ClusterParams::default(),
            ground: HeightParams::default(),
            training: TrainingParams::default(),
            forest: ForestParams::breiman(),
            boosting: BoostingParams::default(),
            bagging: BaggingParams::default(),
            linear: LinearParams::default(),
            regularise: RegulariseParams::default(),
        }
    }
}

offers_classifiers!(ClustersRecipe);

impl OneStage for ClustersRecipe {
    fn training(&self) -> &TrainingParams {
        &self.training
    }

    fn classifier_params(&self) -> ClassifierParams {
        self.classifier()
    }

    fn describe(&self, scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Description> {
        let params = ClusterTableParams {
            set: self.set,
            form: self.form,
            colour: self.colour,
            metres_per_unit: None,
            clusters: self.clusters.clone(),
            height: self.ground.clone(),
        };
        let points = scene.some_points(monitor)?;
        let ClusterTable { table, automatic, .. } = table_of_points(scene, &points, &params, monitor)?;
        Ok(Description { points, spheres: None, table, found: automatic.reasons.join("; ") })
    }
}

impl System for ClustersRecipe {
    const NAME: &'static str = "clusters";
    type Learned = Nothing;
    type Report = OneStageReport;

    fn validate(&self) -> Result<()> {
        self.clusters.validate()?;
        self.ground.validate()?;
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
        let colours = if self.colour { names::COLOUR.map(String::from).to_vec() } else { Vec::new() };
        [colours, self.training.columns()].concat()
    }

    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 170 } else { 300 }
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
