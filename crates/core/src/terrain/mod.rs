//! The lie of the land: what is road, how high a point stands above it, and on which side of its border.
