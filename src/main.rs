//! mpm
fn main() {}
