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
    use crate::nn::training::{Optimiser, Schedule};
    use crate::recipes::{Descriptors, Heights, Placement, Regularise};
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
}
