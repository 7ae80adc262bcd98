//! What a renderer must get right, known beforehand: through the whole way from a scene file to
//! pixels, by every backend.

mod adaptive;
mod edges;
mod glass;
mod kit;
mod light;
mod places;
mod sampling;
mod skips;
