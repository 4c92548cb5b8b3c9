//! Training of networks for objects.

use super::*;
use crate::nn::arrays::{Array, Arrays};
use crate::nn::objects::{ObjectAugmentation, Objects};
use crate::nn::objects::{ObjectShape, Sample};
use crate::nn::sparse::DensityParams;
use crate::parallel::Monitor;

/// Horizontal and vertical bars at random places in noise.
fn bars(count: usize, seed: u64) -> Objects {
    let mut draws = stream(seed, 0);
    let (mut samples, mut labels) = (Vec::new(), Vec::new());
    for number in 0..count {
        let (upright, at) = (number % 2 == 1, draws.below(12) as u64);
        let mut keys: Vec<u64> = (2..10).map(|i| if upright { i * 12 + at } else { at * 12 + i }).collect();
        keys.extend((0..6).map(|_| draws.below(144) as u64));
        keys.sort_unstable();
        keys.dedup();
        let values = vec![1.0; keys.len()];
        samples.push(Sample::Entries(keys, values));
        labels.push(u16::from(upright));
    }
    Objects { shape: ObjectShape { channels: 1, extent: vec![12, 12] }, samples, labels }
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| i.to_string()).collect()
}

fn settings() -> (ObjectNetParams, ObjectLearning) {
    let level = |channels: usize| ObjectLevel { channels: vec![channels; 2], density: Some(0.4) };
    let network = ObjectNetParams { levels: vec![level(4), level(8)], hidden: 16, ..ObjectNetParams::default() };
    let learning = ObjectLearning {
        epochs: 8,
        batch: 16,
        regulariser: DensityParams { strength: 0.01, ..DensityParams::default() },
        pruning: 0.02,
        augment: ObjectAugmentation::NONE,
        ..ObjectLearning::default()
    };
    (network, learning)
}

#[test]
fn bars_are_classified_and_weights_never_return() {
    let (objects, monitor) = (bars(200, 1), Monitor::default());
    let (network, learning) = settings();
    let mut training = ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
    let reports: Vec<EpochReport> = (0..8).map(|_| training.epoch(&objects, &monitor).unwrap()).collect();
    assert!(reports[7].loss < 0.5 * reports[0].loss, "{reports:?}");
    assert!(reports.windows(2).all(|pair| pair[1].weights <= pair[0].weights));
    assert!(reports[7].weights < reports[0].weights && reports[7].bytes > 0);
    let model = training.model();
    let others = bars(100, 2);
    let found = model.predict_proba(&others, &monitor).unwrap();
    let right = found.chunks_exact(2).zip(&others.labels).filter(|(p, l)| (p[1] > p[0]) == (**l == 1)).count();
    assert!(right >= 95, "{right} of 100");
    let read = ObjectModel::from_arrays(&model.to_arrays().unwrap()).unwrap();
    assert_eq!(read, model);
    assert!(
        read.predict_proba(&Objects { shape: ObjectShape { channels: 1, extent: vec![144] }, ..others }, &monitor)
            .is_err()
    );
}

#[test]
fn training_goes_on_from_a_checkpoint_to_the_same_bytes_on_any_number_of_threads() {
    let (objects, monitor) = (bars(60, 3), Monitor::default());
    let (network, learning) = settings();
    let start = || ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
    let run = |threads: usize, stop: Option<usize>| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut training = start();
            for epoch in 0..5 {
                if stop == Some(epoch) {
                    let bytes = training.to_arrays(&objects).unwrap().to_bytes().unwrap();
                    training = start();
                    let arrays = Arrays::from_bytes(&bytes, std::path::Path::new("x")).unwrap();
                    training.resume(&arrays, &objects).unwrap();
                }
                training.epoch(&objects, &monitor).unwrap();
            }
            training.to_arrays(&objects).unwrap().to_bytes().unwrap()
        })
    };
    let whole = run(1, None);
    assert!(run(2, Some(0)) == whole && run(3, Some(3)) == whole);
    // Other samples or settings are refused.
    let arrays = start().to_arrays(&objects).unwrap();
    assert!(start().resume(&arrays, &bars(60, 4)).unwrap_err().to_string().contains("other settings or samples"));
    let other = ObjectLearning { rate: 0.02, ..learning };
    let mut other = ObjectTraining::new(&network, &other, &objects, &names(2)).unwrap();
    assert!(other.resume(&arrays, &objects).is_err());
}

#[test]
fn a_damaged_checkpoint_is_refused() {
    let objects = bars(6, 1);
    let level = ObjectLevel { channels: vec![1], density: Some(0.4) };
    let network = ObjectNetParams { levels: vec![level], hidden: 1, ..ObjectNetParams::default() };
    let learning = ObjectLearning { batch: 3, pruning: 0.1, ..settings().1 };
    let start = || ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
    let mut training = start();
    training.epoch(&objects, &Monitor::default()).unwrap();
    let arrays = training.to_arrays(&objects).unwrap();
    let bytes = arrays.to_bytes().unwrap();
    let read = |bytes: &[u8]| Arrays::from_checked_bytes(bytes, std::path::Path::new("x"));
    start().resume(&read(&bytes).unwrap(), &objects).unwrap();
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&flipped).is_err(), "bit {bit}");
    }
    // With a checksum that is right, but numbers that do not belong together.
    let refused = |name: &str, values: Vec<u64>| {
        let mut arrays = arrays.clone();
        arrays.put(name, Array::Whole(values));
        start().resume(&arrays, &objects).unwrap_err().to_string()
    };
    assert!(refused("steps", vec![3]).contains("epochs of 2 steps"));
    assert!(refused("steps", vec![u64::MAX]).contains("epochs of 2 steps"));
    assert!(refused("steps", vec![]).contains("epochs of 2 steps"));
    assert!(refused("epochs", vec![u64::MAX]).contains("epochs of 2 steps"));
    assert!(refused("warned.0", vec![2, 1]).contains("ascending"));
    assert!(refused("warned.0", vec![9]).contains("warned.0"));
}

#[test]
fn samples_without_labels_or_of_another_shape_are_an_error() {
    let objects = bars(20, 1);
    let (network, learning) = settings();
    let mut training = ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
    let monitor = Monitor::default();
    let mut refused = |objects: &Objects| training.epoch(objects, &monitor).unwrap_err().to_string();
    assert!(refused(&Objects { labels: Vec::new(), ..objects.clone() }).contains("labels"));
    assert!(refused(&Objects { labels: vec![0; 3], ..objects.clone() }).contains("3 labels"));
    assert!(refused(&Objects { labels: vec![2; 20], ..objects.clone() }).contains("below 2"));
    let shape = ObjectShape { channels: 1, extent: vec![144] };
    assert!(refused(&Objects { shape: shape.clone(), ..objects.clone() }).contains("[144]"));
    assert!(training.to_arrays(&Objects { shape, ..objects.clone() }).is_err());
    training.epoch(&objects, &monitor).unwrap();
}

#[test]
fn gradients_that_are_not_finite_stop_with_step_and_layer() {
    let mut objects = bars(40, 1);
    objects.samples[3] = Sample::Entries(vec![0, 1], vec![f32::MAX, f32::MAX]);
    let (network, learning) = settings();
    let mut training = ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
    let message = training.epoch(&objects, &Monitor::default()).unwrap_err().to_string();
    assert!(message.contains("step") && message.contains("level0"), "{message}");
    assert!(ObjectTraining::new(&network, &learning, &objects, &names(1)).is_err());
    assert!(ObjectLearning { batch: 0, ..learning }.validate().unwrap_err().to_string().contains("batch"));
}
