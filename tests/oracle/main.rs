//! The analytic shapes against an oracle that shares no formula with them: textbook equations
//! in numbers of 32 digits.
mod edges;
mod kit;
mod lanes;
mod stress;
mod surface;

use tison::bench::truth;
