//! Arguments about units and LAS scales.

use super::Command;
use super::choices::unit;
use clap::Args as ClapArgs;

/// The unit of the coordinates.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct UnitArgs {
    /// Metres per unit of the coordinates, e.g. 0.3048, or feet or us-feet [default: from the file, else 1]
    #[arg(long, value_name = "METRES", value_parser = unit)]
    pub(crate) unit: Option<f64>,
}

/// The LAS scale of coordinates that come from another format.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct ScaleArgs {
    /// LAS scale: step of the integers in which LAS and LAZ store coordinates, one or one each for x, y and z [default:
    /// 0.001, 1e-7 for degrees, or as fine as a thousandth of the point spacing requires]; not from LAS to LAS
    #[arg(long, value_name = "STEP[,STEP,STEP]", value_delimiter = ',')]
    pub(crate) scale: Vec<f64>,
}

impl Command {
    /// The given unit.
    pub(crate) fn unit(&self) -> Option<f64> {
        match self {
            Self::Features(args) => args.unit.unit,
            Self::Normals(args) => args.unit.unit,
            Self::Train(args) => args.unit.unit,
            Self::Classify(args) => args.unit.unit,
            Self::Regularize(args) => args.unit.unit,
            Self::Segment(args) => args.segments.unit.unit,
            Self::Suggest(args) => args.segments.unit.unit,
            Self::Terrain(args) => args.ground.unit.unit,
            Self::Height(args) => args.ground.unit.unit,
            Self::Filter(args) => args.ground.unit.unit,
            Self::Evaluate(args) => args.unit.unit,
            _ => None,
        }
    }

    /// The given scale, one number per axis.
    ///
    /// # Errors
    /// If there are two numbers, or more than three.
    pub(crate) fn scale(&self) -> Result<Option<[f64; 3]>, String> {
        let numbers = match self {
            Self::Convert(args) => &args.scale.scale,
            Self::Merge(args) => &args.scale.scale,
            Self::Features(args) => &args.scale.scale,
            Self::Normals(args) => &args.scale.scale,
            Self::Classify(args) => &args.scale.scale,
            Self::Regularize(args) => &args.scale.scale,
            Self::Segment(args) => &args.scale.scale,
            Self::Suggest(args) => &args.scale.scale,
            Self::Height(args) => &args.scale.scale,
            Self::Filter(args) => &args.scale.scale,
            _ => return Ok(None),
        };
        match numbers[..] {
            [] => Ok(None),
            [all] => Ok(Some([all; 3])),
            [x, y, z] => Ok(Some([x, y, z])),
            _ => Err(format!("--scale: found {} numbers, expected 1 or 3", numbers.len())),
        }
    }
}
