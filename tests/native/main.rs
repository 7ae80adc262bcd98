//! The native tracer against a loop over everything, and against what must hold for every scene.
mod kit;
mod meshes;
mod mixed;
mod placed;
mod shapes;
