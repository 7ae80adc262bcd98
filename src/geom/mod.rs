//! Rays, hits, packets and the primitives they meet. Knows `math` and nothing above it.

mod bounds;
mod mesh;
mod offset;
mod packet;
mod ray;
pub mod triangle;

pub use bounds::Bounds;
pub use mesh::{BAD_FACE, Faults, TriangleMesh};
pub use offset::offset_origin;
pub use packet::{Coherence, HitLanes, LANES, PacketBatch, RayHitPacket, RayPacket, RayQueue};
pub use ray::{Hit, INVALID_ID, Ray};
