//! How right and how fast the tracer is: measured against numbers of 32 digits, against the forms that textbooks
//! print, and against Embree's own answers.
//!
//! | part | job |
//! |---|---|
//! | `truth` | where a ray meets a shape, exactly |
//! | `random`, `setup` | numbers, rays and scenes to measure with |
//! | `closed` | rays in closed meshes: how many leak |
//! | `leaving` | rays that leave surfaces: how many meet them again |
//!
//! The tests ask the same questions with fewer rays.

pub mod closed;
pub mod leaving;
pub mod random;
pub mod setup;
pub mod truth;
