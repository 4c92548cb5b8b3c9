//! What is done with whole files: conversion, merging, comparison, recovery of damaged ones, statistics.

pub(super) mod convert;
pub(super) mod diff;
pub(super) mod merge;
pub mod salvage;
pub mod statistics;
