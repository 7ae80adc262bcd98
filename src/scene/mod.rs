//! Files in, one frozen scene out. Knows `geom` and `math`.

mod error;
pub mod obj;
pub mod smooth;

pub use error::{Error, Warning};
