//! Classification: the cells of one square after the other, with a margin as wide as the receptive field of the
//! network, so that the result does not depend on the squares.

use super::UNetRecipe;
use super::cells::{Cells, Gathered};
use super::inputs::{OWN, squeezed};
use crate::classes::ClassTable;
use crate::classification::Predictor;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::memory;
use crate::nn::networks::{SceneLevels, UNet};
use crate::nn::parameters::Parameters;
use crate::nn::tape::Tape;
use crate::nn::workspace::Workspace;
use crate::parallel::{Looks, Monitor, sort_watched};
use crate::recipes::classify::predict::{Fit, LOOKED_AT};
use crate::recipes::classify::rules::{BUILDING, GROUND, plan_cell};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, regularise};
use crate::recipes::system::System;
use crate::recipes::training::networks::{check_values, restore};

/// Edge of a square, in cells.
const SQUARE: i64 = 768;

/// Occupied neighbours of a cell, on average, below which cells are too small for a cloud. On a surface they are 8.
const FEW: f64 = 2.0;

/// Points sorted into squares.
struct Squares<'a> {
    points: &'a Points,
    voxel: f64,
    /// Edge, in cells.
    edge: i64,
    /// (square, point), ascending.
    members: Vec<([i64; 2], u32)>,
}

impl<'a> Squares<'a> {
    fn new(points: &'a Points, voxel: f64, edge: i64, monitor: &Monitor) -> Result<Self> {
        let square = |i: usize| {
            let [x, y, _] = points.positions.xyz(i);
            [x, y].map(|c| (f64::from(c) / voxel) as i64 / edge)
        };
        let mut members: Vec<([i64; 2], u32)> = (0..points.len()).map(|i| (square(i), i as u32)).collect();
        sort_watched(&mut members, monitor)?;
        Ok(Self { points, voxel, edge, members })
    }

    /// The points of a square.
    fn of(&self, square: [i64; 2]) -> &[([i64; 2], u32)] {
        let first = self.members.partition_point(|member| member.0 < square);
        let count = self.members[first..].partition_point(|member| member.0 == square);
        &self.members[first..first + count]
    }

    /// The points of a square, then those within `margin` cells of it.
    fn with_margin(&self, square: [i64; 2], margin: i64) -> Vec<u32> {
        let mut all: Vec<u32> = self.of(square).iter().map(|member| member.1).collect();
        let (low, high) = (square.map(|s| s * self.edge - margin), square.map(|s| (s + 1) * self.edge + margin));
        let near = |&(_, point): &([i64; 2], u32)| {
            let [x, y, _] = self.points.positions.xyz(point as usize);
            let cell = [x, y].map(|c| (f64::from(c) / self.voxel) as i64);
            (0..2).all(|a| (low[a]..high[a]).contains(&cell[a]))
        };
        for dx in -1..=1 {
            for dy in -1..=1 {
                if (dx, dy) != (0, 0) {
                    let other = self.of([square[0] + dx, square[1] + dy]);
                    all.extend(other.iter().filter(|member| near(member)).map(|member| member.1));
                }
            }
        }
        all
    }
}

/// The network of a model.
struct TrainedNet<'a> {
    recipe: &'a UNetRecipe,
    net: UNet,
    parameters: Parameters<f32>,
    workspace: Workspace<f32>,
    voxel: f64,
}

impl<'a> TrainedNet<'a> {
    fn of(recipe: &'a UNetRecipe, job: &Job<'_>) -> Result<Self> {
        let Some(voxel) = recipe.voxel else {
            return Err(Error::ModelMismatch("a model of the recipe unet needs a voxel".into()));
        };
        let inputs = OWN + recipe.inputs.width();
        check_values(job.model, recipe.network.values(inputs, job.model.classes.len())?)?;
        let (net, mut parameters) = UNet::new::<f32>(&recipe.network, inputs, job.model.classes.len(), recipe.seed)?;
        restore(&mut parameters, job.model, net.width())?;
        Ok(Self { recipe, net, parameters, workspace: Workspace::default(), voxel })
    }

    /// The features of the cells of these points.
    fn features(&self, points: &Points, numbers: &[f32], of: &[u32], monitor: &Monitor) -> Result<CellFeatures> {
        let width = self.recipe.inputs.width();
        let mut gathered = Gathered::default();
        for &point in of {
            let at = points.positions.xyz(point as usize).map(|c| f64::from(c) / self.voxel);
            gathered.push(0, at, &numbers[point as usize * width..][..width])?;
        }
        let cells = Cells::new(&gathered, width, monitor)?;
        drop(gathered);
        let scene = SceneLevels::new(cells.sites, self.net.levels(), monitor)?;
        let mut tape = Tape::prediction(&self.parameters, &self.workspace, monitor);
        let inputs = tape.input(cells.inputs, OWN + width);
        let features = self.net.features(&mut tape, &scene, inputs)?;
        Ok(CellFeatures { features: tape.take(features), of_point: cells.of_point, touching: scene.touching() })
    }

    /// A warning if the cells have few neighbours and the network was not trained on clouds as thin.
    fn too_thin(&self, rated: &Rated, result: &Classified, job: &Job<'_>) -> Option<String> {
        let neighbours = rated.touching as f64 / rated.cells.max(1) as f64;
        let trained = self.recipe.lowest_density().min(job.model.fingerprint.density);
        (neighbours < FEW && result.density < trained).then(|| {
            format!(
                "the cells of {} m have {neighbours:.1} occupied neighbours on average (8 on a surface): the cloud is too thin for \
                 this model; train one with larger cells, and on copies as thin (training.densities)",
                self.voxel
            )
        })
    }
}

/// Cells and their features.
struct CellFeatures {
    /// One row a cell.
    features: Vec<f32>,
    /// Cell of each point.
    of_point: Vec<u32>,
    /// Pairs of cells that touch each other.
    touching: usize,
}

/// Points by their cells in plan.
type Columns = crate::voxels::cells::Cells<[i32; 2]>;

fn columns(points: &Points, edge: f64, monitor: &Monitor) -> Result<Columns> {
    Columns::new(points.len(), |point| plan_cell(points, point as u32, edge), monitor)
}

/// Which points are too low for a building, and the classes that this is about.
struct LowBuildings {
    ground: usize,
    building: usize,
    classes: usize,
    /// Least height, as the input channel has it.
    least: f32,
}

impl LowBuildings {
    /// If the recipe has a least height and the model what it takes.
    fn of(recipe: &UNetRecipe, classes: &ClassTable) -> Option<Self> {
        let (ground, building) = (classes.position(GROUND)?, classes.position(BUILDING)?);
        let least = squeezed(recipe.lowest_building as f32);
        (recipe.inputs.height && recipe.lowest_building > 0.0).then_some(Self {
            ground,
            building,
            classes: classes.len(),
            least,
        })
    }

    /// Gives the ground what a building has of the probabilities of low points, but not where a wall stands: in columns with a
    /// higher point that is most likely of a building. `heights` are those of the input channel.
    fn correct(&self, columns: &Columns, heights: &[f32], values: &mut [f32], monitor: &Monitor) -> Result<()> {
        let is_low = |point: u32| heights[point as usize] < self.least;
        let mut looks = Looks::at(monitor);
        for column in 0..columns.len() {
            let points = columns.of(column);
            looks.steps(points.len())?;
            let is_wall = |&point: &u32| {
                let row = &values[point as usize * self.classes..][..self.classes];
                !is_low(point) && row.iter().all(|&value| value <= row[self.building])
            };
            if points.iter().any(is_wall) {
                continue;
            }
            for &point in points.iter().filter(|&&point| is_low(point)) {
                let row = &mut values[point as usize * self.classes..][..self.classes];
                row[self.ground] += std::mem::take(&mut row[self.building]);
            }
        }
        Ok(())
    }
}

/// Probabilities of points, and how the features compare with those of the training.
#[derive(Default)]
struct Rated {
    values: Vec<f32>,
    fit: Fit,
    /// Number of cells.
    cells: usize,
    /// Pairs of cells that touch each other.
    touching: usize,
}

impl TrainedNet<'_> {
    /// Rates all points, in squares of `edge` cells.
    fn rate(&self, points: &Points, job: &Job<'_>, edge: i64, monitor: &Monitor) -> Result<Rated> {
        let (model, classes, width) = (job.model, job.model.classes.len(), self.net.width());
        let numbers = self.recipe.inputs.of_points(job.scene.cloud, points, &self.recipe.ground, monitor)?;
        let squares = Squares::new(points, self.voxel, edge, monitor)?;
        let what = format!("probabilities of {} points", points.len());
        let values = memory::filled(0.0f32, points.len() * classes, &what)?;
        let mut rated = Rated { values, ..Rated::default() };
        monitor.stage("classify", points.len() as u64);
        for square in squares.members.chunk_by(|a, b| a.0 == b.0) {
            let all = squares.with_margin(square[0].0, self.recipe.network.reach() as i64);
            let CellFeatures { features, of_point, touching } = self.features(points, &numbers, &all, monitor)?;
            rated.cells += features.len() / width;
            rated.touching += touching;
            let mut found = vec![0.0; features.len() / width * classes];
            model.classifier.predict_proba(&features, &mut found)?;
            let looked_at = features.chunks_exact(width).step_by(LOOKED_AT as usize);
            looked_at.for_each(|row| rated.fit.look(row, &model.fingerprint));
            for (&point, &cell) in all.iter().zip(&of_point).take(square.len()) {
                let row = &found[cell as usize * classes..][..classes];
                rated.values[point as usize * classes..][..classes].copy_from_slice(row);
            }
            self.workspace.recycle(features);
            monitor.advance(square.len() as u64);
        }
        if let Some(low) = LowBuildings::of(self.recipe, &model.classes) {
            let heights: Vec<f32> = numbers.iter().step_by(self.recipe.inputs.width()).copied().collect();
            let columns = columns(points, self.voxel, monitor)?;
            low.correct(&columns, &heights, &mut rated.values, monitor)?;
        }
        Ok(rated)
    }
}

pub(super) fn classify(recipe: &UNetRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let trained = TrainedNet::of(recipe, job)?;
    let points = job.scene.some_points(monitor)?;
    let rated = trained.rate(&points, job, SQUARE, monitor)?;
    let given = Probabilities { values: &rated.values, classes: job.model.classes.len() };
    let found = regularise(&points.positions, given, job.regularise, monitor)?;
    let mut result = job.decided(&points, &found, monitor)?.compared(rated.fit.shares());
    result.warnings.extend(trained.too_thin(&rated, &result, job));
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, CodeScheme, MetricCloud};
    use crate::nn::networks::UNetParams;
    use crate::random::stream;
    use crate::recipes::classify::ClassifyParams;
    use crate::recipes::labels::{LabelledCloud, Labels};
    use crate::recipes::unet::{Augmentation, LearningParams, UNetInputs};
    use crate::recipes::{Fitted, Model, Nothing, TrainOptions, Trained};
    use std::path::Path;

    /// A meadow with boxes as tall as a house on it; class 6 on the boxes, class 2 on the meadow.
    fn village(seed: u64) -> LabelledCloud {
        let mut draws = stream(seed, 0);
        let boxes: Vec<[f64; 2]> = (0..9).map(|_| [40.0, 40.0].map(|edge| 5.0 + draws.uniform() * edge)).collect();
        let rows: Vec<[f64; 3]> = (0..12_000)
            .map(|_| {
                let [x, y] = [draws.uniform() * 50.0, draws.uniform() * 50.0];
                let roof = boxes.iter().any(|[bx, by]| (x - bx).abs() < 3.0 && (y - by).abs() < 3.0);
                [x, y, 0.1 * draws.uniform() + if roof { 4.0 } else { 0.0 }]
            })
            .collect();
        let codes = rows.iter().map(|row| Some(if row[2] > 2.0 { 6 } else { 2 })).collect();
        LabelledCloud { cloud: Cloud::from_rows(&rows).unwrap(), labels: Labels::new(codes, CodeScheme::Asprs) }
    }

    fn recipe() -> UNetRecipe {
        UNetRecipe {
            voxel: Some(0.8),
            network: UNetParams { widths: vec![8, 8, 8] },
            learning: LearningParams { steps: 25, parts: 2, radius: 24.0, ..LearningParams::default() },
            augment: Augmentation { thin: 0.6, ..Augmentation::default() },
            ..UNetRecipe::default()
        }
    }

    fn trained() -> Model {
        recipe().train(&[village(1)], &Default::default(), &Monitor::default()).unwrap().into()
    }

    #[test]
    fn a_network_names_roofs_of_another_village_and_comes_back_from_its_file() {
        let (model, monitor) = (trained(), Monitor::default());
        let LabelledCloud { cloud, labels } = village(2);
        let found = crate::recipes::classify(&cloud, &model, &ClassifyParams::default(), &monitor).unwrap();
        let right = found.codes.iter().zip(&labels.codes).filter(|(a, b)| Some(**a) == **b).count();
        assert!(right as f64 > 0.97 * cloud.len() as f64, "{right}");
        let again = Model::from_bytes(&model.to_bytes().unwrap(), Path::new("unet.model")).unwrap();
        assert_eq!(again, model);
        assert_eq!(crate::recipes::classify(&cloud, &again, &ClassifyParams::default(), &monitor).unwrap(), found);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(trained), model, "the same bytes with {threads} threads");
        }
        // A file whose recipe has a wider network than its arrays.
        let wide = UNetRecipe { network: UNetParams { widths: vec![512; 7] }, ..recipe() };
        let wide = Model { fitted: Fitted { recipe: wide, learned: Nothing {} }.into(), ..model.clone() };
        let message = crate::recipes::classify(&cloud, &wide, &ClassifyParams::default(), &monitor).unwrap_err();
        assert!(message.to_string().contains("by the model's recipe"), "{message}");
        let none = Model { trained: Trained { network: None, ..model.trained }, ..model };
        let message = crate::recipes::classify(&cloud, &none, &ClassifyParams::default(), &monitor).unwrap_err();
        assert!(message.to_string().contains("needs a network"), "{message}");
    }

    #[test]
    fn what_lies_on_the_ground_is_no_building() {
        let classes = ClassTable::from_codes(&[2, 5, 6]);
        // Two points of a roof on the ground, a wall, grass: heights and probabilities of ground, vegetation and building.
        let rows =
            [[0.5, 0.5, 0.0], [0.6, 0.5, 0.29], [5.5, 0.5, 0.1], [5.5, 0.6, 1.5], [9.5, 0.5, 0.1], [9.5, 0.5, 2.0]];
        let roof = [0.2, 0.1, 0.7];
        let tree = [0.1, 0.8, 0.1];
        let given = [roof, roof, roof, roof, roof, tree].concat();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let order: Vec<usize> = points.frame.index.iter().map(|&row| row as usize).collect();
        let corrected = |recipe: &UNetRecipe| {
            let heights: Vec<f32> = order.iter().map(|&row| squeezed(rows[row][2] as f32)).collect();
            let mut values: Vec<f32> = order.iter().flat_map(|&row| given[3 * row..][..3].to_vec()).collect();
            let monitor = Monitor::default();
            let low = LowBuildings::of(recipe, &classes).unwrap();
            low.correct(&columns(&points, 1.0, &monitor).unwrap(), &heights, &mut values, &monitor).unwrap();
            let own = |row: usize| values[3 * order.iter().position(|&own| own == row).unwrap()..][..3].to_vec();
            (0..rows.len()).map(own).collect::<Vec<_>>()
        };
        let ground = vec![0.9, 0.1, 0.0];
        let expected = [&ground, &ground, &roof.to_vec(), &roof.to_vec(), &ground, &tree.to_vec()];
        assert!(corrected(&recipe()).iter().eq(expected));
        // With 10 m nothing is left of the wall.
        let all = corrected(&UNetRecipe { lowest_building: 10.0, ..recipe() });
        assert!(all[..5].iter().all(|row| *row == ground) && all[5] == [0.1 + 0.1, 0.8, 0.0]);
        let inputs = UNetInputs { height: false, ..UNetInputs::default() };
        for other in [UNetRecipe { lowest_building: 0.0, ..recipe() }, UNetRecipe { inputs, ..recipe() }] {
            assert!(LowBuildings::of(&other, &classes).is_none());
        }
        assert!(LowBuildings::of(&recipe(), &ClassTable::from_codes(&[2, 5])).is_none());
        // The roofs of the village are 4 m high.
        let (model, cloud) = (trained(), village(2).cloud);
        let buildings = |recipe: UNetRecipe| {
            let model = Model { fitted: Fitted { recipe, learned: Nothing {} }.into(), ..model.clone() };
            let found =
                crate::recipes::classify(&cloud, &model, &ClassifyParams::default(), &Monitor::default()).unwrap();
            found.codes.iter().filter(|&&code| code == BUILDING).count()
        };
        assert!(buildings(recipe()) > 1000);
        assert_eq!(buildings(UNetRecipe { lowest_building: 10.0, ..recipe() }), 0);
        assert!(UNetRecipe { lowest_building: f64::NAN, ..recipe() }.validate().is_err());
    }

    #[test]
    fn training_that_was_cut_off_goes_on_from_its_checkpoint_to_the_same_model() {
        let folder = tempfile::tempdir().unwrap();
        let recipe = UNetRecipe {
            network: UNetParams { widths: vec![4, 4] },
            learning: LearningParams { steps: 110, parts: 1, radius: 12.0, ..LearningParams::default() },
            ..recipe()
        };
        let options = TrainOptions { checkpoint: Some(folder.path().join("steps")), ..TrainOptions::default() };
        let train = |options: &TrainOptions, monitor: &Monitor| recipe.train(&[village(1)], options, monitor);
        let stopped = Monitor::default();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let stop = |(stage, done, _): (&str, u64, u64)| stage == "train" && done > 60;
                while !stop(stopped.progress()) {
                    std::thread::yield_now();
                }
                stopped.cancel();
            });
            assert!(train(&options, &stopped).is_err());
        });
        let result = train(&options, &Monitor::default()).unwrap();
        assert!(result == train(&TrainOptions::default(), &Monitor::default()).unwrap());
        let other = UNetRecipe { seed: 9, ..recipe.clone() }.train(&[village(1)], &options, &Monitor::default());
        assert!(other.unwrap_err().to_string().contains("other settings or clouds"));
        let path = options.checkpoint.clone().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        assert!(train(&options, &Monitor::default()).unwrap_err().to_string().contains("safetensors"));
        let forest = crate::recipes::AnyRecipe::named("pyramid").unwrap();
        let message = forest.train(&[village(1)], &options, &Monitor::default()).err().unwrap().to_string();
        assert!(message.contains("checkpoint"), "{message}");
    }

    #[test]
    fn a_cloud_whose_cells_have_no_neighbours_is_warned_of() {
        let (model, monitor) = (trained(), Monitor::default());
        let warnings = |cloud: &Cloud| {
            crate::recipes::classify(cloud, &model, &ClassifyParams::default(), &monitor).unwrap().warnings.join("; ")
        };
        let cloud = village(2).cloud;
        assert!(!warnings(&cloud).contains("too thin"));
        let thin = cloud.select(&(0..cloud.len() as u32).step_by(40).collect::<Vec<_>>());
        let said = warnings(&thin);
        assert!(said.contains("too thin for this model") && said.contains("0.8 m"), "{said}");
    }

    #[test]
    fn squares_leave_no_trace() {
        let (model, monitor) = (trained(), Monitor::default());
        let LabelledCloud { cloud, .. } = village(3);
        let metric = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let (params, regularise) = (ClassifyParams::default(), recipe().regularise);
        let job = Job {
            scene: &metric,
            model: &model.trained,
            params: &params,
            regularise: &regularise,
            lowest_density: f64::INFINITY,
        };
        let recipe = recipe();
        let trained = TrainedNet::of(&recipe, &job).unwrap();
        let points = metric.some_points(&monitor).unwrap();
        let whole = trained.rate(&points, &job, 1000, &monitor).unwrap().values;
        // The margin must not reach beyond the next square.
        let edge = recipe.network.reach() as i64 + 1;
        assert!(edge < 30);
        assert_eq!(trained.rate(&points, &job, edge, &monitor).unwrap().values, whole);
    }
}
