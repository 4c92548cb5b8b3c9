//! Growing of one round's trees: gradient histograms of quantised features, the best splits, leaf by leaf.

pub(in crate::classification::boosting) mod blocks;
pub(in crate::classification::boosting) mod data;
pub(in crate::classification::boosting) mod grow;
pub(in crate::classification::boosting) mod histogram;
pub(in crate::classification::boosting) mod split;
pub(in crate::classification::boosting) mod training_rows;
pub(in crate::classification::boosting) mod tree;
