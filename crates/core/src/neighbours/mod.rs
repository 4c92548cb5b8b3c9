//! Who is near whom.
