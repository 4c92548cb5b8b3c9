//! The progress of a training, and the checkpoint file from which it resumes with bit-identical results.

use crate::error::{Error, Result};
use crate::nn::arrays::{Array, Arrays};
use crate::nn::parameters::Parameters;
use crate::nn::training::{OptimiserState, checkpoint};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::Path;

/// Steps between two writings of the file.
const EVERY: usize = 50;

/// Parameters and all that training remembers from step to step.
pub(in crate::recipes) struct Progress {
    pub(in crate::recipes) parameters: Parameters<f32>,
    pub(in crate::recipes) state: OptimiserState<f32>,
    /// Loss of each step.
    pub(in crate::recipes) losses: Vec<f64>,
    /// Occupied cells of all steps.
    pub(in crate::recipes) cells: u64,
}

/// A file that training goes on from.
pub(in crate::recipes) struct Checkpoint<'a> {
    path: &'a Path,
    /// Settings and a checksum of the clouds.
    text: String,
}

impl Progress {
    /// The parameters at the start.
    pub(in crate::recipes) fn new(parameters: Parameters<f32>) -> Self {
        Self { parameters, state: OptimiserState::default(), losses: Vec::new(), cells: 0 }
    }
}

impl<'a> Checkpoint<'a> {
    /// The file of a training with these settings; `feed` gives a checksum all that is learned from.
    ///
    /// # Errors
    /// Never for a recipe.
    pub(in crate::recipes) fn new(
        path: &'a Path,
        recipe: &impl Serialize,
        feed: impl FnOnce(&mut Sha256),
    ) -> Result<Self> {
        let mut sum = Sha256::new();
        feed(&mut sum);
        let sum: String = sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let text = serde_json::to_string(&(recipe, sum)).map_err(|e| Error::input(e.to_string()))?;
        Ok(Self { path, text })
    }

    /// Goes on from the file, if there is one.
    ///
    /// # Errors
    /// If the file is damaged, or was made with other settings or clouds.
    pub(in crate::recipes) fn resume(&self, progress: &mut Progress) -> Result<()> {
        if !self.path.exists() {
            return Ok(());
        }
        let arrays = Arrays::load_checked(self.path)?;
        if arrays.text != self.text {
            let found = "was made with other settings or clouds (allowed: the same; otherwise remove it)";
            return Err(Error::ModelMismatch(format!("the checkpoint {} {found}", self.path.display())));
        }
        progress.state = checkpoint::restore(&arrays, &mut progress.parameters)?;
        progress.losses = arrays.double("losses")?.to_vec();
        progress.cells = arrays.whole("cells")?.first().copied().unwrap_or(0);
        match progress.losses.len() as u64 == progress.state.steps {
            true => Ok(()),
            false => Err(Error::ModelMismatch("the checkpoint has not a loss for each step".into())),
        }
    }

    /// Writes the file after every 50 steps and after the last.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(in crate::recipes) fn follow(&self, progress: &Progress, steps: usize) -> Result<()> {
        let done = progress.losses.len();
        if !done.is_multiple_of(EVERY) && done < steps {
            return Ok(());
        }
        let mut arrays = Arrays::new(self.text.clone());
        checkpoint::store(&mut arrays, &progress.parameters, &progress.state);
        arrays.put("losses", Array::Double(progress.losses.clone()));
        arrays.put("cells", Array::Whole(vec![progress.cells]));
        arrays.save(self.path)
    }
}
