//! How right and how fast the tracer is: measured against numbers of 32 digits, against the forms that textbooks
//! print, and against Embree's own answers.
//!
//! | part | job |
//! |---|---|
//! | `truth` | where a ray meets a shape, exactly |
//! | `random`, `setup` | numbers, rays and scenes to measure with |
//! | `textbook`, `robust` | the shapes as books test them, in f32, and as careful ones do |
//! | `wrong` | wrong answers about single shapes |
//! | `closed` | rays in closed meshes: how many leak |
//! | `leaving` | rays that leave surfaces: how many meet them again |
//! | `cost` | the time of a test and of a refinement |
//! | `stability` | all of that in one report |
//! | `skip` | what is left out: what that saves, and that it changes nothing |
//! | `record` | the rays of a render, asked again without it |
//! | `speed` | the native tracer, Embree and a bare loop over Embree |
//! | `error` | run time against error of whole pictures |
//! | `report`, `plot`, `bars` | tables, pages, SVG |
//!
//! The tests ask the same questions with fewer rays.

pub mod bars;
pub mod closed;
pub mod cost;
pub mod error;
pub mod leaving;
pub mod plot;
pub mod record;
pub mod report;
pub mod robust;
pub mod setup;
pub mod skip;
pub mod speed;
pub mod stability;
pub mod textbook;
pub mod truth;
pub mod wrong;
