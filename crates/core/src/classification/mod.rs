//! Classification: learning names from examples, and naming.
