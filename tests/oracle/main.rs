//! The analytic shapes against an oracle that shares no formula with them: textbook equations
//! in numbers of 32 digits.
mod dd;
mod edges;
mod kit;
mod lanes;
mod stress;
mod surface;
mod truth;
