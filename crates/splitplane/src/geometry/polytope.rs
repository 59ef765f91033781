//! Convex polytopes.
