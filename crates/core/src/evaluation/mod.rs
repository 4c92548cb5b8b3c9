//! Comparing a result with the truth.
