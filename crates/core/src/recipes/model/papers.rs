//! Recipes as in their papers, without our additions: the files in `assets/recipes`.

use crate::error::Result;
use crate::recipes::model::any::AnyRecipe;

/// Name and text of each.
const PAPERS: [(&str, &str); 5] = [
    ("pyramid-paper", include_str!("../../../assets/recipes/pyramid-paper.toml")),
    ("weak-paper", include_str!("../../../assets/recipes/weak-paper.toml")),
    ("objects-paper", include_str!("../../../assets/recipes/objects-paper.toml")),
    ("clusters-paper", include_str!("../../../assets/recipes/clusters-paper.toml")),
    ("windows-paper", include_str!("../../../assets/recipes/windows-paper.toml")),
];

impl AnyRecipe {
    /// The names of the recipes as in their papers.
    pub const PAPERS: [&'static str; PAPERS.len()] = [PAPERS[0].0, PAPERS[1].0, PAPERS[2].0, PAPERS[3].0, PAPERS[4].0];

    /// Whether a recipe has that name, [`AnyRecipe::PAPERS`] among them.
    pub fn is_name(name: &str) -> bool {
        Self::names().contains(&name) || Self::PAPERS.contains(&name)
    }

    /// The recipe as in its paper with that name; `None` if there is none.
    pub(super) fn paper(name: &str) -> Option<Result<Self>> {
        PAPERS.iter().find(|(known, _)| *known == name).map(|(_, text)| Self::from_toml(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::ForestParams;
    use crate::cloud::{Cloud, CodeScheme};
    use crate::nn::training::{Optimiser, Schedule};
    use crate::parallel::Monitor;
    use crate::random::stream;
    use crate::recipes::{Descriptors, Heights, LabelledCloud, Labels, Model, Placement, Regularise, TrainOptions};
    use crate::segmentation::{ClusterForm, CutPursuitSteps, LocalGraphParams, SlicParams};

    #[test]
    fn recipes_of_papers_have_none_of_the_additions_and_are_valid() {
        for name in AnyRecipe::PAPERS {
            let recipe = AnyRecipe::named(name).unwrap();
            recipe.validate().unwrap();
            let own = AnyRecipe::named(recipe.name()).unwrap();
            assert!(recipe != own && name == format!("{}-paper", own.name()));
            match recipe {
                AnyRecipe::Weak(weak) => {
                    assert_eq!((weak.descriptors, weak.shares.power), (Descriptors::Paper, 0.0));
                    assert!(!weak.labels.hold && !weak.labels.fit_partition);
                    assert_eq!(weak.regularise.partition.cut_pursuit, CutPursuitSteps::paper());
                    assert_eq!((weak.regularise.method, weak.regularise.near), (Regularise::SegmentCrf, f64::INFINITY));
                    assert_eq!(weak.regularise.starts, 1);
                }
                AnyRecipe::Pyramid(pyramid) => {
                    assert_eq!(pyramid.regularise.method, Regularise::None);
                    assert_eq!((pyramid.training.rare_below, pyramid.training.keep_samples), (0, 0));
                    assert_eq!((pyramid.training.max_ratio, pyramid.forest.trees), (4.0, 50));
                }
                AnyRecipe::Objects(objects) => {
                    assert_eq!(objects.heights, Heights::Datum);
                    assert_eq!(objects.segments.local_graphs, LocalGraphParams::paper());
                    assert_eq!(objects.segments.slic, SlicParams::paper());
                }
                AnyRecipe::Clusters(clusters) => {
                    assert_eq!((clusters.form, clusters.clusters.edge_rounds), (ClusterForm::Rank, 0));
                    assert_eq!(clusters.forest, ForestParams::breiman());
                    assert_eq!((clusters.training.voxel, clusters.training.max_ratio), (0.0, f64::INFINITY));
                    assert_eq!((clusters.regularise.method, clusters.training.keep_samples), (Regularise::None, 0));
                }
                AnyRecipe::Windows(windows) => {
                    assert_eq!((windows.voxel, windows.placement), (Some(0.025), Placement::Centred));
                    let learning = &windows.learning;
                    assert_eq!((learning.steps, learning.batch, learning.turn_every), (74_700, 100, 100));
                    assert_eq!(learning.optimiser, Optimiser::Adadelta { rho: 0.9, epsilon: 1e-6 });
                    assert_eq!((learning.rate, learning.schedule), (1.0, Schedule::Constant));
                    assert_eq!((windows.training.voxel, windows.training.max_ratio), (0.0, f64::INFINITY));
                }
                other => panic!("{}", other.name()),
            }
        }
    }

    /// A meadow (class 2) with three flat roofs (class 6), 11 points in a supervoxel.
    fn roofs() -> LabelledCloud {
        let mut draws = stream(4, 0);
        let middles = [[4.0, 4.0], [12.0, 5.0], [7.0, 12.0]];
        let rows: Vec<[f64; 3]> = (0..2000)
            .map(|_| {
                let [x, y] = [16.0 * draws.uniform(), 16.0 * draws.uniform()];
                let roof = middles.iter().any(|m| (x - m[0]).abs() < 2.0 && (y - m[1]).abs() < 2.0);
                [x, y, 0.1 * draws.uniform() + if roof { 4.0 } else { 0.0 }]
            })
            .collect();
        let codes = rows.iter().map(|row| Some(if row[2] > 2.0 { 6 } else { 2 })).collect();
        LabelledCloud { cloud: Cloud::from_rows(&rows).unwrap(), labels: Labels::new(codes, CodeScheme::Asprs) }
    }

    /// Settings with which a training is short.
    fn short(name: &str) -> &'static [&'static str] {
        match name {
            "windows-paper" => &[
                "learning.steps=1",
                "learning.batch=2",
                "network.scales=2",
                "network.channels=[2]",
                "network.hidden=4",
            ],
            _ => &["forest.trees=3"],
        }
    }

    #[test]
    fn recipes_of_papers_can_be_trained_and_come_back_from_their_files() {
        for name in AnyRecipe::PAPERS {
            let recipe = AnyRecipe::named(name).unwrap().with_settings(short(name).iter().copied()).unwrap();
            let trained = recipe.train(&[roofs()], &TrainOptions::default(), &Monitor::default());
            let (model, report) = trained.unwrap_or_else(|e| panic!("{name}: {e}"));
            let codes: Vec<u8> = model.trained.classes.classes().iter().map(|class| class.code).collect();
            assert_eq!(codes, [2, 6], "{name}");
            assert!(report.classes().iter().all(|class| class.samples > 0), "{name}");
            let bytes = model.to_bytes().unwrap();
            let again = Model::from_bytes(&bytes, "a.model".as_ref()).unwrap();
            assert!(again.fitted == model.fitted && again.to_bytes().unwrap() == bytes, "{name}");
        }
    }
}
