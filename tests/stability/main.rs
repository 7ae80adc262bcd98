//! The stress list: where numbers are far from 1, close together or just beside each other, both backends give the
//! answers of exact arithmetic. docs/stability.md has the list with what was measured.
#[cfg(feature = "embree")]
mod agreement;
mod closed;
mod kit;
mod leaving;
mod lens;
mod optics;
mod places;
mod shapes;
