//! What a scene costs in memory: its buffers, and the hierarchy over them.

use super::style::{bytes, counted};
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions, Estimate};
use tison::scene::{Buffers, Scene};

/// Bytes of a scene as it is rendered.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    buffers: Buffers,
    /// Of all backends together.
    hierarchy: u64,
    /// Most bytes while it is built.
    hierarchy_peak: u64,
    is_estimate: bool,
    /// Triangles that are stored: those of a mesh that is placed many times count once.
    triangles: usize,
    /// The hierarchy has nothing but triangles and their instances in it.
    only_triangles: bool,
}

impl Cost {
    /// With the hierarchies as they are.
    pub fn of_built(scene: &Scene, backends: &[AnyBackend]) -> Self {
        let built = backends.iter().map(|b| (b.bytes(), b.peak_bytes()));
        Self { is_estimate: false, ..Self::of(scene).with(built) }
    }

    /// With the hierarchies that so many rays would have built, estimated.
    pub fn of_unbuilt(scene: &Scene, kinds: &[BackendKind], rays_expected: u64) -> Self {
        let cancel = AtomicBool::new(false);
        let options = BuildOptions { rays_expected, ..BuildOptions::new(&cancel) };
        let estimates = kinds.iter().map(|&kind| Estimate::of(kind, scene, &options));
        Self::of(scene).with(estimates.map(|e| (e.bytes, e.peak_bytes)))
    }

    /// With hierarchies that are built one after the other: bytes, and most while it is built.
    fn with(mut self, hierarchies: impl Iterator<Item = (u64, u64)>) -> Self {
        for (bytes, peak) in hierarchies {
            self.hierarchy_peak = self.hierarchy_peak.max(self.hierarchy + peak);
            self.hierarchy += bytes;
        }
        self
    }

    fn of(scene: &Scene) -> Self {
        Self {
            buffers: scene.buffers(),
            hierarchy: 0,
            hierarchy_peak: 0,
            is_estimate: true,
            triangles: scene.stored_triangles(),
            only_triangles: scene.shapes() == 0,
        }
    }

    /// Bytes of buffers and of the hierarchy for each triangle that is stored; where there are shapes too, nobody can
    /// say what of the hierarchy is whose.
    fn per_triangle(&self) -> Option<(f64, Option<f64>)> {
        let of = |bytes: f64| bytes / self.triangles as f64;
        let hierarchy = self.only_triangles.then(|| of(self.hierarchy as f64));
        (self.triangles > 0).then(|| (of(self.buffers.of_meshes() as f64), hierarchy))
    }

    /// For one line of a summary.
    pub fn text(&self) -> String {
        let about = if self.is_estimate { "about " } else { "" };
        let each = self.per_triangle().map_or(String::new(), |(buffers, hierarchy)| {
            let hierarchy = hierarchy.map_or(String::new(), |h| format!(" + {about}{h:.1} in the hierarchy"));
            format!("; a triangle takes {buffers:.1} B in buffers{hierarchy}")
        });
        format!(
            "scene {}, hierarchy {about}{} ({} while it is built){each}",
            bytes(self.buffers.total() as u64),
            bytes(self.hierarchy),
            bytes(self.hierarchy_peak)
        )
    }

    /// What takes how much, the largest first.
    pub fn buffers_text(&self) -> String {
        let b = &self.buffers;
        let mut parts = [
            ("positions", b.positions),
            ("indices", b.indices),
            ("normals", b.normals),
            ("texture coordinates", b.uvs),
            ("materials of faces", b.face_materials),
            ("shapes", b.shapes),
            ("textures", b.textures),
        ];
        parts.sort_by_key(|&(_, bytes)| std::cmp::Reverse(bytes));
        let parts = parts.into_iter().filter(|&(_, n)| n > 0).map(|(name, n)| format!("{name} {}", bytes(n as u64)));
        let parts: Vec<_> = parts.collect();
        if parts.is_empty() { counted(0, "byte") } else { parts.join(", ") }
    }

    /// The figures. Others read these keys: add, never rename.
    pub fn json(&self) -> Value {
        let b = &self.buffers;
        json!({
            "scene_bytes": b.total(),
            "backend_bytes": self.hierarchy,
            "buffers": {
                "positions": b.positions, "indices": b.indices, "normals": b.normals, "uvs": b.uvs,
                "face_materials": b.face_materials, "shapes": b.shapes, "textures": b.textures,
            },
            "hierarchy_bytes": self.hierarchy,
            "hierarchy_peak_bytes": self.hierarchy_peak,
            "hierarchy_is_estimate": self.is_estimate,
            "bytes_per_triangle": self.per_triangle().map(|(buffers, hierarchy)| {
                json!({ "buffers": buffers, "hierarchy": hierarchy })
            }),
        })
    }
}
