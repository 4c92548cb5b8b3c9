//! Shape of a kernel.

use super::MARGIN;
use crate::error::{Error, Result};

/// Step from output to output, at most.
const MOST_STRIDE: usize = 1 << 30;

/// Shape of a kernel, the same along all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Weights along an axis, 1 to 15.
    pub size: usize,
    /// Step from output to output, in cells of the input, 1 to 2^30.
    pub stride: usize,
    /// Step from weight to weight, in cells of the input.
    pub dilation: usize,
    /// Cells by which the first weight lies before the output's own cell.
    pub padding: usize,
}

impl Kernel {
    /// A kernel centred on each site: of odd size, with stride 1.
    pub fn centred(size: usize) -> Self {
        Self { size, stride: 1, dilation: 1, padding: size / 2 }
    }

    /// A kernel that divides the grid into cubes of `size` cells.
    pub fn cubes(size: usize) -> Self {
        Self { size, stride: size, dilation: 1, padding: 0 }
    }

    /// Number of weights in `D` dimensions.
    pub fn volume<const D: usize>(self) -> usize {
        self.size.pow(D as u32)
    }

    /// The weight along the last axis that lies so many cells after the first one.
    #[inline(always)]
    pub(super) fn weight_at(self, step: usize) -> Option<usize> {
        match self.dilation {
            1 => Some(step),
            dilation => step.is_multiple_of(dilation).then_some(step / dilation),
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(self) -> Result<()> {
        let near = |cells: Option<usize>| cells.is_some_and(|cells| cells < MARGIN as usize);
        match self {
            Self { size, .. } if !(1..=15).contains(&size) => Err(Error::parameter("size", size, "1 to 15")),
            Self { stride, .. } if !(1..=MOST_STRIDE).contains(&stride) => {
                Err(Error::parameter("stride", stride, format!("1 to {MOST_STRIDE}")))
            }
            Self { dilation: 0, .. } => Err(Error::parameter("dilation", 0, "1 or more")),
            Self { size, dilation, .. } if !near(size.checked_mul(dilation)) => {
                let allowed =
                    format!("1 to {}, so that the kernel reaches below {MARGIN} cells", (MARGIN as usize - 1) / size);
                Err(Error::parameter("dilation", dilation, allowed))
            }
            Self { padding, .. } if !near(Some(padding)) => {
                Err(Error::parameter("padding", padding, format!("below {MARGIN} cells")))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_out_of_range_are_named() {
        let of = |kernel: Kernel| kernel.validate().unwrap_err().to_string();
        assert!(of(Kernel::centred(17)).contains("size"));
        assert!(of(Kernel { stride: 0, ..Kernel::centred(3) }).contains("stride"));
        assert!(of(Kernel { dilation: 20, ..Kernel::centred(3) }).contains("dilation"));
        // Products that do not fit, or would be negative.
        for dilation in [usize::MAX, usize::MAX / 3 + 1, 1 << 63, (1 << 62) + 1] {
            let message = of(Kernel { dilation, ..Kernel::centred(3) });
            assert!(message.contains("dilation") && message.contains("1 to 10"), "{message}");
        }
        assert!(of(Kernel { padding: usize::MAX, ..Kernel::centred(3) }).contains("padding"));
        assert!(of(Kernel { stride: usize::MAX, ..Kernel::centred(3) }).contains("stride"));
        assert!(Kernel { dilation: 10, ..Kernel::centred(3) }.validate().is_ok());
    }
}
