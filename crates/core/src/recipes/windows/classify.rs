//! Classification: windows in blocks, so that memory does not depend on the size of the cloud beyond its cells.

use super::WindowsRecipe;
use super::occupancy::{Frame, Occupancy};
use crate::classification::Predictor;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::memory;
use crate::nn::networks::{Mode, WindowNet};
use crate::nn::parameters::Parameters;
use crate::parallel::Monitor;
use crate::recipes::classify::predict::{Fit, LOOKED_AT};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, regularise};
use crate::recipes::training::networks::{check_values, restore};

/// Windows that pass through the network together.
const BLOCK: usize = 128;

/// The network of a model.
struct TrainedNet {
    net: WindowNet,
    parameters: Parameters<f32>,
    frame: Frame,
}

/// Probabilities of points, and how the features compare with those of the training.
struct Rated {
    values: Vec<f32>,
    fit: Fit,
}

impl TrainedNet {
    fn of(recipe: &WindowsRecipe, job: &Job<'_>) -> Result<Self> {
        let Some(voxel) = recipe.voxel else {
            return Err(Error::ModelMismatch("a model of the recipe windows needs a voxel".into()));
        };
        check_values(job.model, recipe.network.parameters(job.model.classes.len())?)?;
        let (net, mut parameters) = WindowNet::new::<f32>(&recipe.network, job.model.classes.len(), recipe.seed)?;
        restore(&mut parameters, job.model, net.width())?;
        Ok(Self { net, parameters, frame: Frame::of(recipe, voxel) })
    }

    /// Rates all points; those that share their windows share the result.
    fn rate(&self, points: &Points, job: &Job<'_>, monitor: &Monitor) -> Result<Rated> {
        let (model, classes, width) = (job.model, job.model.classes.len(), self.net.width());
        let cells = Occupancy::new(self.frame, points.positions.clone(), monitor)?;
        let what = format!("probabilities of {} points", points.len());
        let mut rated = Rated { values: memory::filled(0.0f32, points.len() * classes, &what)?, fit: Fit::default() };
        let members = cells.sharing(monitor)?;
        let groups: Vec<&[(u64, u32)]> = members.chunk_by(|a, b| a.0 == b.0).collect();
        monitor.stage("classify", points.len() as u64);
        for block in groups.chunks(BLOCK) {
            monitor.check()?;
            let shown: Vec<u32> = block.iter().map(|group| group[0].1).collect();
            let windows = cells.tensors(&shown, monitor)?;
            let features = self.net.pass(&self.parameters, windows, Mode::Prediction, monitor)?.into_hidden();
            let mut found = vec![0.0; block.len() * classes];
            model.classifier.predict_proba(&features, &mut found)?;
            let looked_at = features.chunks_exact(width).step_by(LOOKED_AT as usize);
            looked_at.for_each(|row| rated.fit.look(row, &model.fingerprint));
            for (group, row) in block.iter().zip(found.chunks_exact(classes)) {
                for &(_, point) in *group {
                    rated.values[point as usize * classes..][..classes].copy_from_slice(row);
                }
                monitor.advance(group.len() as u64);
            }
        }
        Ok(rated)
    }
}

pub(super) fn classify(recipe: &WindowsRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let trained = TrainedNet::of(recipe, job)?;
    let points = job.scene.some_points(monitor)?;
    let rated = trained.rate(&points, job, monitor)?;
    let given = Probabilities { values: &rated.values, classes: job.model.classes.len() };
    let found = regularise(&points.positions, given, job.regularise, monitor)?;
    Ok(job.decided(&points, &found, monitor)?.compared(rated.fit.shares()))
}
