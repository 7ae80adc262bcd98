//! Values that sit at the corners of triangles.

/// Normals or texture coordinates, indexed apart from the positions.
#[derive(Clone, Debug, PartialEq)]
pub struct CornerData {
    /// Components one after the other: 3 per normal (unit length, or zero where the file
    /// has a zero one), 2 per texture coordinate.
    pub values: Vec<f32>,
    /// Per triangle and corner the number of the value; [`CornerData::NONE`] where the
    /// corner has none. Absent when the vertex indices of the triangles serve here too.
    pub indices: Option<Vec<[u32; 3]>>,
}

impl CornerData {
    /// Index of a corner that has no value.
    pub const NONE: u32 = u32::MAX;

    /// Numbers of the values at the corners of triangle `prim` of `faces`, the triangles
    /// these values belong to.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    #[must_use]
    pub fn of(&self, faces: &[[u32; 3]], prim: usize) -> [u32; 3] {
        self.indices.as_deref().unwrap_or(faces)[prim]
    }

    /// The `N` components of value `index`; nothing for [`NONE`](Self::NONE).
    #[inline]
    #[must_use]
    pub fn get<const N: usize>(&self, index: u32) -> Option<[f32; N]> {
        let at = N * index as usize;
        self.values.get(at..at.checked_add(N)?)?.try_into().ok()
    }

    /// The `N` components of the three values with these numbers; nothing unless there are all three.
    #[inline]
    #[must_use]
    pub fn three<const N: usize>(&self, numbers: [u32; 3]) -> Option<[[f32; N]; 3]> {
        let [a, b, c] = numbers.map(|i| self.get(i));
        Some([a?, b?, c?])
    }

    /// Bytes of the buffers.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..]) + self.indices.as_ref().map_or(0, |i| size_of_val(&i[..]))
    }
}
