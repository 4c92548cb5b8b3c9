use super::occupancy::{Frame, Occupancy};
use super::*;
use crate::cloud::{Cloud, CodeScheme, Positions};
use crate::nn::training::Optimiser;
use crate::random::stream;
use crate::recipes::classify::ClassifyParams;
use crate::recipes::labels::Labels;
use crate::recipes::{AnyRecipe, Model, Trained};
use std::collections::BTreeSet;
use std::path::Path;

const PLACEMENTS: [Placement; 3] = [Placement::Grid, Placement::Centred, Placement::Doubled];

fn frame(placement: Placement, window: usize) -> Frame {
    Frame { placement, voxel: 0.5, scales: 3, window }
}

/// Random points in a box of 8 m, and one in its middle, the first.
fn scattered(count: usize) -> Vec<[f32; 3]> {
    let mut draws = stream(5, 0);
    let random = (1..count).map(|_| [0; 3].map(|_| (8.0 * draws.uniform() - 4.0) as f32));
    std::iter::once([0.0; 3]).chain(random).collect()
}

fn windows(frame: Frame, rows: &[[f32; 3]], point: u32) -> Vec<Vec<u32>> {
    Occupancy::new(frame, Positions::from_rows(rows), &Monitor::default()).unwrap().windows(point)
}

#[test]
fn windows_of_a_grid_are_those_of_brute_force() {
    let rows = scattered(2000);
    let lowest = [0, 1, 2].map(|a| rows.iter().map(|row| f64::from(row[a])).fold(f64::INFINITY, f64::min));
    for (scale, found) in windows(frame(Placement::Grid, 4), &rows, 7).into_iter().enumerate() {
        let edge = 0.5 * f64::from(1 << scale);
        let cell = |row: &[f32; 3]| [0, 1, 2].map(|a| ((f64::from(row[a]) - lowest[a] + 0.5) / edge).floor() as i64);
        let occupied: BTreeSet<[i64; 3]> = rows.iter().map(cell).collect();
        let [x, y, z] = cell(&rows[7]);
        let all = (0..64).map(|place| (place, [x + place / 16 - 2, y + place / 4 % 4 - 2, z + place % 4 - 2]));
        let expected: Vec<u32> = all.filter(|(_, c)| occupied.contains(c)).map(|(place, _)| place as u32).collect();
        assert!(found == expected && found.len() > 3, "scale {scale}: {found:?}, {expected:?}");
    }
}

#[test]
fn windows_around_a_point_are_those_of_brute_force() {
    let rows = scattered(300);
    for (scale, found) in windows(frame(Placement::Centred, 4), &rows, 7).into_iter().enumerate() {
        let edge = 0.5 * f64::from(1 << scale);
        let place = |row: &[f32; 3]| {
            let at = [0, 1, 2].map(|a| ((f64::from(row[a]) - f64::from(rows[7][a])) / edge).floor() as i64 + 2);
            at.iter().all(|c| (0..4).contains(c)).then(|| (at[0] * 16 + at[1] * 4 + at[2]) as u32)
        };
        let expected: BTreeSet<u32> = rows.iter().filter_map(place).collect();
        assert!(found == expected.iter().copied().collect::<Vec<_>>() && found.len() > 3, "scale {scale}");
    }
}

#[test]
fn a_point_that_stands_twice_changes_no_window() {
    let rows = scattered(60);
    let twice = [&rows[..], &rows[..]].concat();
    for placement in PLACEMENTS {
        for point in 0..60 {
            let own = windows(frame(placement, 8), &rows, point);
            assert!(own == windows(frame(placement, 8), &twice, point) && own.iter().all(|w| !w.is_empty()));
        }
    }
}

#[test]
fn a_quarter_turn_permutes_the_places_of_a_symmetric_window() {
    // In a grid, points in the middle of cells, whose finest cells turn with them; around a point, any points.
    let cells: Vec<[f32; 3]> = scattered(200).iter().map(|row| row.map(|c| c.round() / 2.0)).collect();
    for (placement, window, rows, scales) in
        [(Placement::Doubled, 8, cells, 1), (Placement::Centred, 7, scattered(200), 3)]
    {
        let turned: Vec<[f32; 3]> = rows.iter().map(|&[x, y, z]| [-y, x, z]).collect();
        let [own, other] = [&rows, &turned].map(|rows| windows(frame(placement, window), rows, 0));
        let w = window as u32;
        for scale in 0..scales {
            let permuted: BTreeSet<u32> = own[scale]
                .iter()
                .map(|place| {
                    let [x, y, z] = [place / (w * w), place / w % w, place % w];
                    ((w - 1 - y) * w + x) * w + z
                })
                .collect();
            let found: BTreeSet<u32> = other[scale].iter().copied().collect();
            assert!(found == permuted && found.len() > 9, "{placement:?}, scale {scale}");
            assert_ne!(own[scale], other[scale]);
        }
    }
}

#[test]
fn a_doubled_window_is_that_of_15_cells_with_the_centre_slice_twice() {
    let rows = scattered(400);
    let doubled = windows(frame(Placement::Doubled, 16), &rows, 0);
    let plain = windows(frame(Placement::Grid, 15), &rows, 0);
    for (doubled, plain) in doubled.iter().zip(&plain) {
        let single = |i: u32| if i < 8 { i } else { i - 1 };
        let shown = |place: &u32| {
            let [x, y, z] = [place / 256, place / 16 % 16, place % 16].map(single);
            plain.contains(&((x * 15 + y) * 15 + z))
        };
        assert_eq!(*doubled, (0..4096).filter(shown).collect::<Vec<u32>>());
        assert!(doubled.len() > plain.len());
    }
}

/// A meadow with boxes on it; class 6 on the boxes, class 2 on the meadow.
fn village(seed: u64) -> LabelledCloud {
    let mut draws = stream(seed, 0);
    let boxes: Vec<[f64; 2]> = (0..5).map(|_| [22.0, 22.0].map(|edge| 4.0 + draws.uniform() * edge)).collect();
    let rows: Vec<[f64; 3]> = (0..4000)
        .map(|_| {
            let [x, y] = [draws.uniform() * 30.0, draws.uniform() * 30.0];
            let roof = boxes.iter().any(|[bx, by]| (x - bx).abs() < 2.0 && (y - by).abs() < 2.0);
            [x, y, 0.1 * draws.uniform() + if roof { 3.0 } else { 0.0 }]
        })
        .collect();
    let codes = rows.iter().map(|row| Some(if row[2] > 2.0 { 6 } else { 2 })).collect();
    labelled(&rows, codes)
}

fn labelled(rows: &[[f64; 3]], codes: Vec<Option<u8>>) -> LabelledCloud {
    LabelledCloud { cloud: Cloud::from_rows(rows).unwrap(), labels: Labels::new(codes, CodeScheme::Asprs) }
}

/// A small network.
fn recipe() -> WindowsRecipe {
    WindowsRecipe {
        voxel: Some(0.8),
        network: WindowNetParams { scales: 2, window: 8, channels: vec![4, 8], hidden: 16, dropout: 0.1 },
        learning: WindowsLearning { steps: 60, batch: 24, rate: 1e-2, turn_every: 20, ..WindowsLearning::default() },
        ..WindowsRecipe::default()
    }
}

fn trained(recipe: &WindowsRecipe) -> Model {
    recipe.train(&[village(1)], &TrainOptions::default(), &Monitor::default()).unwrap().into()
}

/// Labels that a model gives, and how many of them are right.
fn classified(model: &Model, known: &LabelledCloud) -> (Classified, usize) {
    let monitor = Monitor::default();
    let found = crate::recipes::classify(&known.cloud, model, &ClassifyParams::default(), &monitor).unwrap();
    let right = found.codes.iter().zip(&known.labels.codes).filter(|(a, b)| Some(**a) == **b).count();
    (found, right)
}

#[test]
fn roofs_of_another_village_are_found_and_the_model_comes_back_from_its_file() {
    let (model, known) = (trained(&recipe()), village(2));
    let (found, right) = classified(&model, &known);
    assert!(right > 3800, "{right} of 4000");
    let again = Model::from_bytes(&model.to_bytes().unwrap(), Path::new("windows.model")).unwrap();
    assert!(again == model && classified(&again, &known).0 == found);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| trained(&recipe())) == model, "the same bytes with {threads} threads");
        assert!(pool.install(|| classified(&model, &known)).0 == found, "the same labels with {threads} threads");
    }
    // Files whose recipes have larger networks than their arrays.
    for (hidden, window, expected) in [(1 << 12, 8, "by the model's recipe"), (1 << 16, 64, "up to 2147483648")] {
        let network = WindowNetParams { hidden, window, channels: vec![512], ..recipe().network };
        let recipe = WindowsRecipe { network, ..recipe() };
        let large = Model { fitted: Fitted { recipe, learned: Nothing {} }.into(), ..model.clone() };
        let found = crate::recipes::classify(&known.cloud, &large, &ClassifyParams::default(), &Monitor::default());
        let message = found.unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let none = Model { trained: Trained { network: None, ..model.trained }, ..model };
    let message = crate::recipes::classify(&known.cloud, &none, &ClassifyParams::default(), &Monitor::default());
    assert!(message.unwrap_err().to_string().contains("needs a network"));
}

#[test]
fn the_other_placements_find_them_too() {
    for placement in [Placement::Centred, Placement::Doubled] {
        let (_, right) = classified(&trained(&WindowsRecipe { placement, ..recipe() }), &village(2));
        assert!(right > 3800, "{placement:?}: {right} of 4000");
    }
}

#[test]
fn points_of_a_finest_cell_share_their_probabilities_in_a_grid_only() {
    let rows = [[0.0; 3], [0.3, 0.2, 0.1], [5.0, 5.0, 0.0], [9.0, 2.0, 3.0]];
    let shared = |placement| {
        let monitor = Monitor::default();
        let rows: Vec<[f32; 3]> = rows.iter().map(|row| row.map(|c| c as f32)).collect();
        let cells = Occupancy::new(frame(placement, 8), Positions::from_rows(&rows), &monitor).unwrap();
        let members = cells.sharing(&monitor).unwrap();
        members.chunk_by(|a, b| a.0 == b.0).map(<[_]>::len).max().unwrap()
    };
    assert_eq!(PLACEMENTS.map(shared), [2, 1, 2]);
}

#[test]
fn twenty_points_can_be_overfitted() {
    let mut draws = stream(8, 0);
    let rows: Vec<[f64; 3]> = (0..20).map(|_| [0; 3].map(|_| 10.0 * draws.uniform())).collect();
    let known = labelled(&rows, (0..20).map(|i| Some([2, 5, 6][i % 3])).collect());
    let recipe = WindowsRecipe {
        learning: WindowsLearning { steps: 150, batch: 20, turn_every: 0, ..recipe().learning },
        training: TrainingParams { voxel: 0.0, ..TrainingParams::default() },
        ..recipe()
    };
    let result = recipe.train(std::slice::from_ref(&known), &TrainOptions::default(), &Monitor::default()).unwrap();
    let (report, model) = (result.report.clone(), result.into());
    assert_eq!(classified(&model, &known).1, 20, "{:?}", report.curve());
    assert!(report.curve()[9] < 0.2 * report.curve()[0]);
    let text = crate::recipes::Report::text(&report);
    assert!(text.contains("loss in each tenth") && text.contains("cells of") && text.contains("at a time"), "{text}");
}

#[test]
fn training_that_was_cut_off_goes_on_from_its_checkpoint_to_the_same_model() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = WindowsRecipe { learning: WindowsLearning { steps: 80, batch: 8, ..recipe().learning }, ..recipe() };
    let options = TrainOptions { checkpoint: Some(folder.path().join("steps")), ..TrainOptions::default() };
    let train = |options: &TrainOptions, monitor: &Monitor| recipe.train(&[village(1)], options, monitor);
    let stopped = Monitor::default();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let stop = |(stage, done, _): (&str, u64, u64)| stage == "train" && done > 52;
            while !stop(stopped.progress()) {
                std::thread::yield_now();
            }
            stopped.cancel();
        });
        assert!(train(&options, &stopped).is_err());
    });
    assert!(
        train(&options, &Monitor::default()).unwrap() == train(&TrainOptions::default(), &Monitor::default()).unwrap()
    );
    let other = recipe.clone().with_seed(9).train(&[village(1)], &options, &Monitor::default());
    assert!(other.unwrap_err().to_string().contains("other settings or clouds"));
}

#[test]
fn settings_out_of_range_are_named() {
    let windows = AnyRecipe::named("windows").unwrap();
    for (setting, name) in [
        ("voxel=0", "voxel"),
        ("learning.steps=0", "learning.steps"),
        ("learning.batch=5000", "learning.batch"),
        ("learning.rate=-1", "learning.rate"),
        ("network.window=2", "network.window"),
        ("network.channels=[]", "network.channels"),
        ("network.dropout=1", "network.dropout"),
        ("learning.optimiser={ adadelta = { rho = 1.0, epsilon = 1e-6 } }", "rho"),
    ] {
        let message = windows.with_settings([setting]).and_then(|r| r.validate()).unwrap_err().to_string();
        assert!(message.contains(name), "{setting}: {message}");
    }
    let optimiser = |settings: &[&str]| match windows.with_settings(settings.iter().copied()).unwrap() {
        AnyRecipe::Windows(recipe) => recipe.learning.optimiser,
        other => panic!("{}", other.name()),
    };
    let given = ["learning.optimiser.sgd.momentum=.9", "learning.optimiser.sgd.decay=0"];
    assert_eq!(optimiser(&given), Optimiser::Sgd { momentum: 0.9, decay: 0.0 });
    let given = ["learning.optimiser.adam-w.beta1=0.8", "learning.optimiser.adam-w.decay=0"];
    assert_eq!(optimiser(&given), Optimiser::AdamW { beta1: 0.8, beta2: 0.999, epsilon: 1e-8, decay: 0.0 });
    let written = AnyRecipe::from_toml("recipe = \"windows\"\n[learning.optimiser.adadelta]\nrho = 0.8\n").unwrap();
    let set = windows.with_settings(["learning.optimiser.adadelta.rho=0.8"]).unwrap();
    assert_eq!(written, set);
    let odd = windows.with_settings(["network.window=15", "placement=doubled"]).unwrap();
    assert!(odd.validate().unwrap_err().to_string().contains("even"));
    assert!(windows.with_settings(["placement=round"]).is_err());
    assert!(trained(&recipe()).fitted.with_settings(["placement=centred"]).is_err());
    let far = Positions::from_rows(&[[0.0; 3], [2e6, 0.0, 0.0]]);
    let message = Occupancy::new(frame(Placement::Grid, 8), far, &Monitor::default()).err().unwrap().to_string();
    assert!(message.contains("cells along an axis"), "{message}");
}
