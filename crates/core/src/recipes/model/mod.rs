//! The model file: classifier, recipe, classes, feature names and a summary of the training data.
//!
//! Safetensors with one metadata entry, a JSON object. It contains the SHA-256 of the whole file, computed with 64
//! zeros in the place of the checksum.

pub(in crate::recipes) mod any;
mod cars;
mod classify;
mod contours;
mod papers;

pub use self::classify::{classify, statistics};
pub use self::contours::{contour_stages, contours};

use self::any::AnyFitted;
use self::cars::knows_cars;
use super::system::{Fitted, System, TrainingResult};
use super::trained::{EarlierStage, Trained};
use crate::classes::ClassTable;
use crate::classification::arrays::{Array, Reader, malformed, print_arrays};
use crate::classification::{Classifier, ClassifierKind};
use crate::error::{Error, Result};
use crate::io::{atomic, is_cloud_name, open};
use crate::nn::parameters::{Parameter, Parameters};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// Newest version of the file format that can be read. Version 1 has only forests, version 2 other classifiers too;
/// version 3 has what was learned besides the classifier, version 4 a first classifier, version 5 a network or a linear
/// classifier, version 6 a classifier of cars, version 7 a second classifier before the last. The lowest possible one is written.
const VERSION: u64 = 7;
/// What the names of the arrays of the earlier classifiers begin with, in their order.
const EARLIER: [&str; 2] = ["first_", "second_"];
/// What the names of the arrays of the classifier of cars begin with.
const CARS: &str = "cars_";
/// What the names of the arrays of the network begin with.
const NETWORK: &str = "network_";
const FORMAT: &str = "scansion model";
const KEY: &str = "scansion";
/// Number of bytes at the start of a file that show whether it is a model: its metadata come first.
const START: u64 = 1 << 16;

/// Everything needed to classify the points of a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The recipe, with every choice made, and what training has learned besides the classifier.
    pub fitted: AnyFitted,
    /// Classes, features and classifiers.
    pub trained: Trained,
}

/// An earlier classifier.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EarlierHeader {
    classifier: ClassifierKind,
    features: Vec<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: String,
    version: u64,
    sha256: String,
    #[serde(default, skip_serializing_if = "is_forest")]
    classifier: ClassifierKind,
    seed: u64,
    recipe: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    learned: String,
    classes: ClassTable,
    features: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    first: Option<EarlierHeader>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    second: Option<EarlierHeader>,
    /// The kind of the classifier of cars, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cars: Option<ClassifierKind>,
    /// Whether there is a network.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    network: bool,
}

fn is_forest(kind: &ClassifierKind) -> bool {
    *kind == ClassifierKind::Forest
}

/// Fails if the file exists and is not a model, for instance a cloud. An empty file may be replaced.
fn check_replaced(path: &Path) -> Result<()> {
    // A file that does not exist or cannot be read is left to the writer.
    let Ok(start) = open::start(path, START) else { return Ok(()) };
    let model = start.get(8..).is_some_and(|json| json.starts_with(b"{") && find(json, FORMAT.as_bytes()).is_some());
    match start.is_empty() || model {
        true => Ok(()),
        false => {
            let reason = "stands there and is no model; give the model another name, or remove this file first";
            Err(Error::io(path, std::io::Error::new(std::io::ErrorKind::AlreadyExists, reason)))
        }
    }
}

impl<S: System> From<TrainingResult<S>> for Model
where
    AnyFitted: From<Fitted<S>>,
{
    fn from(TrainingResult { fitted, trained, .. }: TrainingResult<S>) -> Self {
        Self { fitted: fitted.into(), trained }
    }
}

impl Model {
    /// The bytes of the model file; the same model gives the same bytes.
    ///
    /// # Errors
    /// If classes, names, fingerprint and classifier do not fit together.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.trained.check_shape()?;
        let learned = self.fitted.learned_toml()?;
        let header = Header {
            format: FORMAT.into(),
            version: match (self.trained.earlier.first(), learned.is_empty(), self.trained.classifier.kind()) {
                _ if self.trained.earlier.len() > 1 => VERSION,
                _ if self.trained.cars.is_some() => 6,
                _ if self.trained.network.is_some() => 5,
                (.., ClassifierKind::Linear) => 5,
                (Some(_), ..) => 4,
                (None, false, _) => 3,
                (None, true, ClassifierKind::Forest) => 1,
                (None, true, _) => 2,
            },
            classifier: self.trained.classifier.kind(),
            sha256: "0".repeat(64),
            seed: self.fitted.seed(),
            recipe: self.fitted.recipe().to_toml()?,
            learned,
            classes: self.trained.classes.clone(),
            features: self.trained.feature_names.clone(),
            first: self.trained.earlier.first().map(EarlierHeader::of),
            second: self.trained.earlier.get(1).map(EarlierHeader::of),
            cars: self.trained.cars.as_ref().map(Classifier::kind),
            network: self.trained.network.is_some(),
        };
        let refused = |e: &dyn std::fmt::Display| Error::input(format!("model cannot be written: {e}"));
        let header = serde_json::to_string(&header).map_err(|e| refused(&e))?;
        let mut arrays = self.trained.classifier.arrays();
        arrays.extend(print_arrays(&self.trained.fingerprint));
        let earlier: Vec<Vec<Array>> = self.trained.earlier.iter().map(EarlierStage::arrays).collect();
        let cars = self.trained.cars.as_ref().map(Classifier::arrays).unwrap_or_default();
        let prefixed = EARLIER.iter().zip(&earlier).flat_map(|(prefix, own)| own.iter().map(|array| (*prefix, array)));
        let named = arrays.iter().map(|array| ("", array)).chain(prefixed);
        let named = named.chain(cars.iter().map(|array| (CARS, array)));
        let views = named.map(|(prefix, (name, dtype, len, bytes))| {
            let view = TensorView::new(*dtype, vec![*len], bytes).map_err(|e| refused(&e))?;
            Ok((format!("{prefix}{name}"), view))
        });
        let mut views = views.collect::<Result<Vec<_>>>()?;
        let network = self.trained.network.iter().flat_map(Parameters::iter);
        let network: Vec<(&Parameter<f32>, Vec<u8>)> =
            network.map(|array| (array, array.values.iter().flat_map(|v| v.to_le_bytes()).collect())).collect();
        for (array, bytes) in &network {
            let view = TensorView::new(Dtype::F32, array.shape.clone(), bytes).map_err(|e| refused(&e))?;
            views.push((format!("{NETWORK}{}", array.name), view));
        }
        let metadata = Some([(KEY.to_string(), header)].into_iter().collect());
        let mut bytes = safetensors::serialize(views, metadata).map_err(|e| refused(&e))?;
        let place = find(&bytes, &[b'0'; 64]).ok_or_else(|| refused(&"no place for the checksum"))?;
        let sum = checksum(&bytes, place);
        bytes[place..place + 64].copy_from_slice(sum.as_bytes());
        Ok(bytes)
    }

    /// The checksum in the model file, 64 hexadecimal digits: the same for the same model.
    ///
    /// # Errors
    /// As [`Model::to_bytes`].
    pub fn checksum(&self) -> Result<String> {
        let path = Path::new("model");
        Ok(read_header(&self.to_bytes()?, path)?.sha256)
    }

    /// Reads a model from the bytes of its file; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the field; [`Error::Unsupported`] for a newer version.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        let header = read_header(bytes, path)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| malformed(path, "arrays", e, "safetensors"))?;
        let mut reader = Reader { path, tensors, prefix: "" };
        let (width, classes) = (header.features.len(), header.classes.len());
        if !(1..=65_534).contains(&width) || classes == 0 {
            return Err(malformed(
                path,
                "features",
                format!("{width} features, {classes} classes"),
                "1 or more of each",
            ));
        }
        let fingerprint = reader.fingerprint(width, classes)?;
        let classifier = reader.classifier(header.classifier, width, classes)?;
        let network = if header.network { Some(network_of(&reader)?) } else { None };
        reader.prefix = CARS;
        let cars = header.cars.map(|kind| reader.classifier(kind, width, 2)).transpose()?;
        let earlier = earlier_of(&header, &mut reader)?;
        let fitted = fitted_of(&header, path)?;
        let (classes, feature_names) = (header.classes, header.features);
        let trained = Trained { classes, feature_names, fingerprint, classifier, cars, earlier, network };
        trained.check_shape().map_err(|e| malformed(path, "features", e, "names that differ"))?;
        if trained.cars.is_some() {
            knows_cars(&fitted, &trained).map_err(|e| malformed(path, "cars", e, "none"))?;
        }
        Ok(Self { fitted, trained })
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// As [`Model::from_bytes`]; [`Error::Io`] if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = open::bytes(path, open::MOST_MODEL)?;
        if bytes.starts_with(b"LASF") {
            return Err(Error::input(format!("{}: it is a cloud (LAS or LAZ), not a model", path.display())));
        }
        Self::from_bytes(&bytes, path)
    }

    /// Writes the model file.
    ///
    /// # Errors
    /// As [`Model::to_bytes`]; [`Error::Io`] if the file cannot be written; or if it exists and is not a model.
    pub fn save(&self, path: &Path) -> Result<()> {
        let bytes = self.to_bytes()?;
        check_replaced(path)?;
        atomic::write_bytes(path, &bytes)
    }

    /// Fails now if [`Model::save`] could not write this file later.
    ///
    /// # Errors
    /// As [`atomic::check_output`]; or if the file exists and is not a model.
    pub fn check_output(path: &Path) -> Result<()> {
        atomic::check_output(path)?;
        check_replaced(path)?;
        if is_cloud_name(path) {
            let name = path.display();
            return Err(Error::input(format!("{name}: the extension is that of clouds; call a model e.g. my.model")));
        }
        Ok(())
    }
}

impl EarlierHeader {
    fn of(stage: &EarlierStage) -> Self {
        Self { classifier: stage.classifier.kind(), features: stage.feature_names.clone() }
    }

    /// The classifier, from its arrays.
    fn read(&self, reader: &Reader<'_>, classes: usize) -> Result<EarlierStage> {
        let width = self.features.len();
        if !(1..=65_534).contains(&width) {
            let field = reader.prefix.trim_end_matches('_');
            return Err(malformed(reader.path, field, format!("{width} features"), "1 or more"));
        }
        let classifier = reader.classifier(self.classifier, width, classes)?;
        let fingerprint = reader.has_fingerprint().then(|| reader.fingerprint(width, classes)).transpose()?;
        Ok(EarlierStage { feature_names: self.features.clone(), classifier, fingerprint })
    }
}

/// The classifiers before the last.
fn earlier_of(header: &Header, reader: &mut Reader<'_>) -> Result<Vec<EarlierStage>> {
    if header.first.is_none() && header.second.is_some() {
        return Err(malformed(reader.path, "second", "a second classifier", "one only after a first"));
    }
    let mut stages = Vec::new();
    for (prefix, own) in EARLIER.iter().zip([&header.first, &header.second]) {
        if let Some(own) = own {
            reader.prefix = prefix;
            stages.push(own.read(reader, header.classes.len())?);
        }
    }
    Ok(stages)
}

/// The network, from its arrays.
fn network_of(reader: &Reader<'_>) -> Result<Parameters<f32>> {
    let mut arrays = Vec::new();
    for (name, view) in reader.tensors.tensors() {
        let Some(own) = name.strip_prefix(NETWORK) else { continue };
        if view.dtype() != Dtype::F32 {
            return Err(malformed(reader.path, &name, format!("{:?}", view.dtype()), "F32"));
        }
        let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let values: Vec<f32> = view.data().chunks_exact(4).map(number).collect();
        if let Some(wrong) = values.iter().find(|value| !value.is_finite()) {
            return Err(malformed(reader.path, &name, wrong, "finite numbers"));
        }
        arrays.push((own.to_string(), view.shape().to_vec(), values));
    }
    Ok(Parameters::of_arrays(arrays).sorted())
}

/// The recipe and what was learned, from the header. Weak models before version 3 stored what was learned in the
/// recipe; they are refused with a message that says so.
fn fitted_of(header: &Header, path: &Path) -> Result<AnyFitted> {
    let before = header.version < 3 && header.recipe.contains("recipe = \"weak\"");
    if before {
        let reason = format!(
            "a model of the recipe weak in version {}, from an older program; this one reads version 3: train it again",
            header.version
        );
        return Err(Error::Unsupported { path: path.to_path_buf(), reason });
    }
    AnyFitted::from_toml(&header.recipe, &header.learned)
        .map_err(|e| malformed(path, "recipe", e, "a recipe and what was learned"))
}

fn read_header(bytes: &[u8], path: &Path) -> Result<Header> {
    let wrong = |e: &dyn std::fmt::Display| malformed(path, "header", e, "the header of a Scansion model");
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| wrong(&e))?;
    let entries = metadata.metadata().as_ref();
    let text = entries.and_then(|m| m.get(KEY)).ok_or_else(|| wrong(&"no entry \"scansion\""))?;
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| wrong(&e))?;
    if value.get("format").and_then(serde_json::Value::as_str) != Some(FORMAT) {
        return Err(wrong(&"another format"));
    }
    match value.get("version").and_then(serde_json::Value::as_u64) {
        Some(1..=VERSION) => {}
        Some(version) if version > VERSION => {
            let reason =
                format!("model version {version} is newer than this program, which reads versions up to {VERSION}");
            return Err(Error::Unsupported { path: path.to_path_buf(), reason });
        }
        other => return Err(malformed(path, "version", format!("{other:?}"), format!("1 to {VERSION}"))),
    }
    let header: Header = serde_json::from_value(value).map_err(|e| wrong(&e))?;
    let place = find(bytes, header.sha256.as_bytes()).filter(|_| header.sha256.len() == 64);
    let actual = place.map(|place| checksum(bytes, place)).unwrap_or_default();
    match actual == header.sha256 {
        true => Ok(header),
        false => Err(malformed(path, "sha256", actual, header.sha256)),
    }
}

fn find(bytes: &[u8], part: &[u8]) -> Option<usize> {
    if part.is_empty() { None } else { bytes.windows(part.len()).position(|w| w == part) }
}

/// SHA-256 in hexadecimal of the bytes, with 64 zeros at `place`.
fn checksum(bytes: &[u8], place: usize) -> String {
    let mut sum = Sha256::new();
    sum.update(&bytes[..place]);
    sum.update([b'0'; 64]);
    sum.update(&bytes[place + 64..]);
    sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::testing::blobs;
    use crate::classification::{
        BaggingParams, BoostingParams, Classifier, ClassifierParams, Fingerprint, Forest, ForestParams, Samples,
    };
    use crate::parallel::Monitor;

    fn model(samples: &Samples<'_>) -> Model {
        let params = ForestParams { trees: 2, max_depth: Some(3), ..ForestParams::default() };
        let trained = Trained {
            classes: ClassTable::from_codes(&[2, 5, 6]),
            feature_names: vec!["height".into(), "roughness \"r\"".into()],
            fingerprint: Fingerprint::of(samples, 7.5),
            classifier: Classifier::Forest(Forest::fit(samples, &params, &Monitor::default()).unwrap()),
            cars: None,
            earlier: Vec::new(),
            network: None,
        };
        Model { fitted: AnyFitted::from_toml("seed = 1\n", "").unwrap(), trained }
    }

    #[test]
    fn classifiers_before_the_last_are_read_back_in_their_order() {
        let data = blobs(60, 2, 3, 0.0);
        let mut model = model(&data.samples());
        let stage = |name: &str, trees: usize| {
            let params = ForestParams { trees, max_depth: Some(2), ..ForestParams::default() };
            EarlierStage {
                feature_names: vec![name.into(), "other".into()],
                classifier: Classifier::Forest(Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap()),
                fingerprint: Some(Fingerprint::of(&data.samples(), 1.0)),
            }
        };
        let header = |model: &Model| read_header(&model.to_bytes().unwrap(), Path::new("test.model")).unwrap();
        for (count, version) in [(1, 4), (2, 7)] {
            model.trained.earlier = (0..count).map(|i| stage(&format!("f{i}"), i + 1)).collect();
            assert_eq!(header(&model).version, version);
            assert_eq!(read(&model.to_bytes().unwrap()).unwrap(), model);
        }
        model.trained.earlier.push(stage("f2", 3));
        assert!(model.to_bytes().unwrap_err().to_string().contains("up to 2"));
        // A second one without a first.
        model.trained.earlier.truncate(2);
        let bytes = model.to_bytes().unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let mut reader = Reader { path: Path::new("test.model"), tensors, prefix: "" };
        let error = earlier_of(&Header { first: None, ..header(&model) }, &mut reader).unwrap_err().to_string();
        assert!(error.contains("only after a first"), "{error}");
    }

    fn small() -> Model {
        let data = blobs(60, 2, 3, 0.0);
        model(&data.samples())
    }

    fn read(bytes: &[u8]) -> Result<Model> {
        Model::from_bytes(bytes, Path::new("test.model"))
    }

    /// The error for a file with a correct checksum whose forest was altered.
    fn tampered(change: impl FnOnce(&mut Forest)) -> Error {
        let mut model = small();
        if let Classifier::Forest(forest) = &mut model.trained.classifier {
            change(forest);
        }
        read(&model.to_bytes().unwrap()).unwrap_err()
    }

    #[test]
    fn a_model_comes_back_from_its_file_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.model");
        let model = small();
        model.save(&path).unwrap();
        assert_eq!(Model::load(&path).unwrap(), model);
        assert_eq!(model.to_bytes().unwrap(), small().to_bytes().unwrap());
        assert!(matches!(Model::load(&folder.path().join("none")), Err(Error::Io { .. })));
    }

    #[test]
    fn boosted_and_bagged_trees_come_back_from_their_files() {
        let data = blobs(200, 2, 3, 0.0);
        let boosting = ClassifierParams::Boosting(BoostingParams { rounds: 3, ..BoostingParams::default() });
        let bagging = ClassifierParams::Bagging(BaggingParams { trees: 2, ..BaggingParams::default() });
        for params in [boosting, bagging] {
            let classifier = params.train(&data.samples(), &Monitor::default()).unwrap();
            let mut model = model(&data.samples());
            model.trained.classifier = classifier;
            let bytes = model.to_bytes().unwrap();
            assert_eq!(read(&bytes).unwrap(), model);
            for i in (0..bytes.len()).step_by(7) {
                let mut broken = bytes.clone();
                broken[i] ^= 1;
                assert!(read(&broken).is_err(), "byte {i}");
            }
        }
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_noticed() {
        let bytes = small().to_bytes().unwrap();
        for i in 0..bytes.len() {
            for mask in [1, 0x20, 0x80, 0xff] {
                let mut broken = bytes.clone();
                broken[i] ^= mask;
                assert!(read(&broken).is_err(), "byte {i} with {mask:#x}");
            }
            assert!(read(&bytes[..i]).is_err(), "cut at {i}");
        }
        assert!(read(&[bytes.as_slice(), &[0]].concat()).is_err());
    }

    #[test]
    fn indices_out_of_range_and_cycles_are_named() {
        let message = |change: fn(&mut Forest)| tampered(change).to_string();
        let inner = |f: &Forest| f.nodes.iter().position(|n| n.cut != LEAF).unwrap();
        const LEAF: u16 = u16::MAX;
        assert!(matches!(small().trained.classifier, Classifier::Forest(f) if inner(&f) == 0));
        assert!(message(|f| f.nodes[0].left = 0).contains("node_left at node 0"));
        assert!(message(|f| f.nodes[0].left = 1_000_000).contains("node_left at node 0"));
        assert!(message(|f| f.nodes[0].left += 2).contains("node_left"));
        assert!(message(|f| f.nodes[0].feature = 9).contains("node_feature at node 0"));
        assert!(message(|f| f.nodes[0].cut = 999).contains("node_cut at node 0"));
        assert!(message(|f| f.roots[1] = 0).contains("roots"));
        assert!(message(|f| f.roots.clear()).contains("roots"));
        assert!(message(|f| f.leaves[0] = f32::NAN).contains("leaves at row 0"));
        assert!(message(|f| f.leaves.truncate(4)).contains("leaves"));
        assert!(message(|f| f.importance[0] = f64::NAN).contains("importance"));
        assert!(message(|f| f.nodes.truncate(3)).contains("roots"));
    }

    #[test]
    fn a_newer_version_is_refused_by_its_number() {
        let bytes = small().to_bytes().unwrap();
        let text = br#"\"version\":1"#;
        let place = find(&bytes, text).unwrap() + text.len() - 1;
        let mut newer = bytes;
        newer[place] = b'8';
        assert!(matches!(read(&newer), Err(Error::Unsupported { reason, .. }) if reason.contains("version 8")));
    }

    #[test]
    fn what_was_learned_comes_back_and_weak_models_before_version_3_are_refused_by_name() {
        let learned = "shares = [0.5, 0.25, 0.25]\nroad = []\n\n[[labels]]\nat = [0.1, 652000.3, 1e-7]\ncode = 6\n";
        let fitted = AnyFitted::from_toml("recipe = \"weak\"", learned).unwrap();
        let model = Model { fitted, ..small() };
        let bytes = model.to_bytes().unwrap();
        assert_eq!(read(&bytes).unwrap(), model);
        let mut header = read_header(&bytes, Path::new("test.model")).unwrap();
        assert_eq!(header.version, 3);
        header.version = 1;
        let error = fitted_of(&header, Path::new("test.model")).unwrap_err();
        assert!(matches!(&error, Error::Unsupported { reason, .. } if reason.contains("weak")), "{error}");
    }

    #[test]
    fn names_that_do_not_fit_are_refused_when_written() {
        let Model { fitted, trained } = small();
        let refused = |trained: Trained| Model { fitted: fitted.clone(), trained }.to_bytes().is_err();
        assert!(refused(Trained { feature_names: vec!["a".into()], ..trained.clone() }));
        assert!(refused(Trained { feature_names: vec!["a".into(), "a".into()], ..trained.clone() }));
        assert!(refused(Trained { fingerprint: Fingerprint::default(), ..trained }));
    }
}
