//! Floats, colour, samples. Knows nothing of rays or scenes.

pub mod colour;
mod frame;
mod sampling;

pub use frame::Frame;
pub use sampling::{PixelSamples, concentric_disc};
