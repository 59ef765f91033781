//! The command `splitplane`.

fn main() {}
