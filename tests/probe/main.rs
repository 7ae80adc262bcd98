//! Single rays through the probe, by every backend, against truth in numbers of 32 digits.

#[path = "../oracle/dd.rs"]
#[allow(dead_code, reason = "shared with the tests of the shapes, which use all of it")]
mod dd;
mod kit;
mod meshes;
mod rows;
mod shapes;
mod triangles;
#[path = "../oracle/truth.rs"]
#[allow(dead_code, reason = "as above")]
mod truth;
