//! Rays, hits, packets and the primitives they meet. Knows `math` and `simd`, nothing above them.

mod bounds;
mod cube;
mod cylinder;
mod exact_triangle;
mod mesh;
mod offset;
mod packet;
mod quad;
mod ray;
mod shape;
mod shape_set;
mod sphere;
mod transform;
pub mod triangle;

pub use bounds::Bounds;
pub use cube::Cube;
pub use cylinder::Cylinder;
pub use exact_triangle::ExactTriangle;
pub use mesh::{BAD_FACE, Faults, TriangleMesh};
pub use offset::offset_origin;
pub use packet::{Coherence, HitLanes, LANES, PacketBatch, RayHitPacket, RayPacket, RayQueue};
pub use quad::Quad;
pub use ray::{Hit, Hit64, INVALID_ID, Ray, Ray64};
pub use shape::{Lanes, Shape, ShapeError, ShapePoint};
pub use shape_set::{Affine, Plain, ShapeSet};
pub use sphere::Sphere;
pub use transform::invert;
pub(crate) use transform::{cofactors, mirrors, normal_matrix};
