//! Floats and frames. Knows nothing of the rooms above.

mod frame;

pub use frame::Frame;
