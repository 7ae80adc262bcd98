//! Floats, long numbers, colour, samples. Knows nothing of rays or scenes.

pub mod colour;
pub mod dd;
mod filter;
mod frame;
mod pow;
mod random;
mod sampling;

pub use filter::Filter;
pub use frame::Frame;
pub use pow::pow01;
pub use random::Random;
pub(crate) use sampling::hash;
pub use sampling::{
    Branch, PixelSamples, Sampler, Sampling, SobolLanes, concentric_disc, polar_disc, rejection_disc,
    uniform_radius_disc,
};
