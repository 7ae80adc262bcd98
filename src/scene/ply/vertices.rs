//! Vertices on their way into a mesh.

use super::super::obj::parse::{LARGEST, unit};
use super::super::obj::points::PointWriter;
use super::file::Trouble;
use super::layout::{Layout, NORMAL, PLACE, UV, Values};
use crate::math::Frame;
use glam::DVec3;

/// Where the vertices of a part go. What is not wanted is empty.
#[derive(Debug)]
pub(super) struct Target<'a> {
    pub(super) points: &'a mut [f32],
    pub(super) normals: &'a mut [f32],
    pub(super) uvs: &'a mut [f32],
}

/// Checks vertices and writes them.
pub(super) struct VertexWriter<'a> {
    layout: &'a Layout<'a>,
    points: PointWriter<'a>,
    normals: std::slice::ChunksExactMut<'a, f32>,
    uvs: std::slice::ChunksExactMut<'a, f32>,
    has_normals: bool,
    has_uvs: bool,
}

impl<'a> VertexWriter<'a> {
    pub(super) fn new(layout: &'a Layout<'a>, frame: &Frame, target: Target<'a>) -> Self {
        let (normals, uvs) = (target.normals, target.uvs);
        Self {
            has_normals: !normals.is_empty(),
            has_uvs: !uvs.is_empty(),
            normals: normals.chunks_exact_mut(3),
            uvs: uvs.chunks_exact_mut(2),
            ..Self::of(layout, PointWriter::new(frame, target.points))
        }
    }

    /// Writes points only.
    pub(super) fn of(layout: &'a Layout<'a>, points: PointWriter<'a>) -> Self {
        let (normals, uvs) = ([][..].chunks_exact_mut(3), [][..].chunks_exact_mut(2));
        Self { layout, points, normals, uvs, has_normals: false, has_uvs: false }
    }

    /// Takes the next vertex: number `item`, at byte `at` of its part.
    #[inline]
    pub(super) fn put(&mut self, item: u64, at: usize, values: &Values) -> Result<(), Trouble> {
        let place = three(values, PLACE);
        if let Some(axis) = bad_axis(place) {
            return Err(self.fault(item, at, PLACE + axis, values));
        }
        self.points.put(place).ok_or(Trouble::Changed)?;
        if self.has_normals {
            let normal = three(values, NORMAL);
            if let Some(axis) = bad_axis(normal) {
                return Err(self.fault(item, at, NORMAL + axis, values));
            }
            let slot = self.normals.next().ok_or(Trouble::Changed)?;
            slot.copy_from_slice(&unit(normal).as_vec3().to_array());
        }
        if self.has_uvs {
            let uv = [values[UV] as f32, values[UV + 1] as f32];
            if let Some(axis) = uv.iter().position(|x| !x.is_finite()) {
                return Err(self.fault(item, at, UV + axis, values));
            }
            self.uvs.next().ok_or(Trouble::Changed)?.copy_from_slice(&uv);
        }
        Ok(())
    }

    /// The largest coordinate of all.
    pub(super) fn finish(self) -> Result<f64, Trouble> {
        self.points.finish().ok_or(Trouble::Changed)
    }

    #[cold]
    fn fault(&self, item: u64, at: usize, slot: usize, values: &Values) -> Trouble {
        let (value, name) = (values[slot], self.layout.name(slot));
        let what = if !value.is_finite() {
            format!("'{name}' is {value}, not a finite number")
        } else if slot < UV {
            format!("'{name}' is {value:e}, beyond the largest coordinate, 1e300")
        } else {
            format!("'{name}' is {value:e}, too large for a texture coordinate")
        };
        Trouble::Item { item, at, what }
    }
}

/// The place of a vertex, if that can be one.
pub(super) fn place(values: &Values) -> Option<DVec3> {
    let place = three(values, PLACE);
    bad_axis(place).is_none().then_some(place)
}

#[inline]
fn three(values: &Values, first: usize) -> DVec3 {
    DVec3::new(values[first], values[first + 1], values[first + 2])
}

/// The first axis along which `v` is no sensible number.
#[inline]
fn bad_axis(v: DVec3) -> Option<usize> {
    let good = |x: f64| x.abs() <= LARGEST;
    if good(v.x) && good(v.y) && good(v.z) { None } else { (0..3).find(|&axis| !good(v[axis])) }
}
