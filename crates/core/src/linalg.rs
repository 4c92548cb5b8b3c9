//! Small linear algebra on neighbourhoods.
