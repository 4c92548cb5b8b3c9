//! Pictures of clouds.
