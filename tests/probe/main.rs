//! Single rays through the probe, by every backend, against truth in numbers of 32 digits.

mod kit;
mod meshes;
mod rows;
mod shapes;
mod triangles;
