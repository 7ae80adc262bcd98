//! A hybrid ray tracer: Embree and a pure-Rust tracer answer the same rays.
//!
//! # The house
//!
//! Each room has one job and knows only the rooms below it:
//!
//! | room | job |
//! |---|---|
//! | [`verify`] | the same rays through both backends, the same file through both readers |
//! | [`bench`](mod@bench) | how right and how fast all that is, measured |
//! | [`render`] | tiles, waves of rays, shading |
//! | [`probe`] | single rays in f64, exact answers |
//! | [`backend`] | the seam: who answers a ray |
//! | [`metrics`] | how far two pictures are apart |
//! | [`scene`] | files in, one frozen scene out |
//! | [`film`] | pixels in, files out, and pictures back in |
//! | [`geom`] | rays, hits, packets, primitives |
//! | [`math`] | floats, colour, samples |
//!
//! `embree` holds the safe wrapper of the C library; it, the crate `embree4-sys` and the
//! run-time choice of vector instructions in [`simd`] are the only places with `unsafe`.
//!
//! # The way of one ray
//!
//! A tile fills packets of camera rays, the backend answers them, hits become surface
//! points in f64, every light gets its shadow rays as one batch, and mirrored and
//! refracted rays are the next wave.
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod backend;
pub mod bench;
#[cfg(feature = "embree")]
#[allow(unsafe_code, reason = "the one room that talks to C")]
pub mod embree;
pub mod film;
pub mod geom;
pub mod math;
pub mod metrics;
pub mod probe;
pub mod render;
pub mod scene;
#[allow(unsafe_code, reason = "calling a function compiled for instructions that were looked for first")]
pub mod simd;
pub mod verify;
