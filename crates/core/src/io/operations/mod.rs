//! What is done with whole files: conversion, changes, selection of points, merging, comparison, recovery of damaged
//! ones, statistics.

pub(super) mod added;
pub(super) mod convert;
pub(super) mod diff;
pub(super) mod merge;
pub mod salvage;
pub(super) mod select;
pub mod statistics;
