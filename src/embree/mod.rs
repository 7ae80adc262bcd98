//! The safe wrapper of Embree 4: triangle meshes and shapes written in Rust go in, rays are answered.
//!
//! | file | job |
//! |---|---|
//! | `device` | one handle of the library: threads, memory limit, release check |
//! | `scene` | [`SceneBuilder`] takes geometry, [`SceneBuilder::commit`] turns it into a [`Scene`] |
//! | `query` | rays, packets and batches against a [`Scene`] |
//! | `packet` | the C call for each packet width, and the proof that our packets are C's |
//! | `rescale` | directions of a length at which Embree would lose hits |
//! | `user` | [`PrimSet`]: shapes that Embree calls back for |
//! | `instance` | scenes placed in others |
//! | `exact` | scenes for rays in f64: shapes see those, triangles the rounded ones |
//! | `raw` | what Embree answers by itself, to compare with |
//! | `fault` | panics in those callbacks, kept until Rust code can raise them again |
//!
//! It knows `geom` and the crate `embree4-sys`; nothing of the latter leaves this room. What must not happen at the
//! same time cannot be written: a builder is owned and changes, a scene is shared and does not.
//!
//! ```
//! use std::sync::Arc;
//! use tison::embree::{Device, DeviceConfig, SceneBuilder, SceneOptions};
//! use tison::geom::{Ray, TriangleMesh};
//!
//! let device = Device::new(&DeviceConfig::default())?;
//! let mut builder = SceneBuilder::new(&device, SceneOptions::default())?;
//! let corners = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
//! let floor = builder.mesh(Arc::new(TriangleMesh::new(corners, vec![[0, 1, 2]])))?;
//! let scene = builder.commit(None)?;
//!
//! let hit = scene.intersect(&Ray::new(glam::vec3(0.2, 0.2, 5.0), -glam::Vec3::Z)).expect("aimed at the triangle");
//! assert_eq!((hit.geom_id, hit.prim_id), (floor, 0));
//! assert!((hit.t - 5.0).abs() < 1e-5);
//! # Ok::<(), tison::embree::Error>(())
//! ```

mod device;
mod error;
mod exact;
mod fault;
mod instance;
mod packet;
mod query;
mod raw;
mod rescale;
mod scene;
mod user;

pub use device::{Device, DeviceConfig};
pub use error::Error;
pub use exact::{ExactBuilder, ExactScene, HitsAlong};
pub use packet::Width;
pub use raw::Bare;
pub use scene::{Quality, Scene, SceneBuilder, SceneOptions};
pub use user::PrimSet;
