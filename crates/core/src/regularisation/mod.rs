//! Neighbours agree: labellings of least energy.
