//! The hierarchy in memory: nodes of four boxes, leaves of up to four triangles or one other thing.

use super::bins::Box4;
use glam::{Vec3, Vec4};

/// Children of a node, and triangles of a leaf: the lanes of one SSE register.
pub(super) const WIDTH: usize = 4;

/// Most things in one hierarchy: in the worst case each has a leaf of its own, and a
/// [`Child`] has 29 bits for the leaf (the last value is kept for [`Child::NONE`]).
pub(super) const MAX_THINGS: usize = (1 << 29) - 1;

/// Most nodes on the way from the root to a leaf. The builder stops to follow the
/// surface-area heuristic at [`HEURISTIC_DEPTH`] and halves what is left from there on:
/// where 2^29 things meet, the last node with two of them is 28 halvings away.
pub(super) const MAX_DEPTH: usize = HEURISTIC_DEPTH + 28;

/// See [`MAX_DEPTH`].
pub(super) const HEURISTIC_DEPTH: usize = 56;

/// What a child of a node is, in 32 bits: an inner node, a leaf with the number of things
/// in it, or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// The first node.
    pub(super) const ROOT: Self = Self(0);
    /// A child whose box no ray enters.
    pub(super) const NONE: Self = Self(u32::MAX);

    pub(super) fn node(index: usize) -> Self {
        debug_assert!(index < Self::LEAF as usize);
        Self(index as u32)
    }

    pub(super) fn leaf(leaf: usize, count: usize) -> Self {
        debug_assert!(leaf < MAX_THINGS && (1..=WIDTH).contains(&count));
        Self(Self::LEAF | (leaf as u32) << 2 | (count as u32 - 1))
    }

    #[inline]
    pub(super) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Index of the node, where it is one.
    #[inline]
    pub(super) fn node_index(self) -> usize {
        self.0 as usize
    }

    /// Number of the leaf, where it is one.
    #[inline]
    pub(super) fn leaf_index(self) -> usize {
        ((self.0 & !Self::LEAF) >> 2) as usize
    }

    /// Bits of the lanes of the block that hold a triangle, where it is a leaf.
    #[inline]
    pub(super) fn lanes(self) -> u32 {
        0b1111 >> (3 - (self.0 & 3))
    }

    /// The same child where nodes and leaves have moved up by these numbers.
    pub(super) fn moved(self, nodes: usize, leaves: usize) -> Self {
        if self == Self::NONE {
            self
        } else if self.is_leaf() {
            Self(self.0 + ((leaves as u32) << 2))
        } else {
            Self(self.0 + nodes as u32)
        }
    }
}

/// Four boxes side by side and what is in them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// `bounds[axis][0]` is the low side of the four boxes, `bounds[axis][1]` the high one.
    pub(super) bounds: [[Vec4; 2]; 3],
    pub(super) child: [Child; WIDTH],
}

impl Node {
    /// A node without children: every lane's box is inside out.
    pub(super) const EMPTY: Self =
        Self { bounds: [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3], child: [Child::NONE; WIDTH] };

    /// Puts the box of a child into `lane`, a little wider than it is.
    pub(super) fn set_bounds(&mut self, lane: usize, bounds: Box4) {
        let Box4 { lo, hi } = bounds.padded();
        for axis in 0..3 {
            self.bounds[axis][0][lane] = lo[axis];
            self.bounds[axis][1][lane] = hi[axis];
        }
    }
}

/// Up to four triangles side by side. The corners are copied here: a test needs no
/// index, and the lanes are what the f32 filter reads.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Block {
    /// `corners[k][axis]`: coordinate `axis` of corner `k` of the four triangles.
    pub(super) corners: [[Vec4; 3]; 3],
    /// Number of each triangle.
    pub(super) id: [u32; WIDTH],
}

impl Block {
    pub(super) const EMPTY: Self = Self { corners: [[Vec4::ZERO; 3]; 3], id: [u32::MAX; WIDTH] };

    /// Puts a triangle into `lane`.
    pub(super) fn set(&mut self, lane: usize, corners: [Vec3; 3], id: u32) {
        for (to, from) in self.corners.iter_mut().zip(corners) {
            for axis in 0..3 {
                to[axis][lane] = from[axis];
            }
        }
        self.id[lane] = id;
    }

    /// Corners of the triangle in `lane`.
    #[inline]
    pub(super) fn triangle(&self, lane: usize) -> [Vec3; 3] {
        self.permuted(lane, [0, 1, 2])
    }

    /// The same with coordinates in the order of `axes`.
    #[inline]
    pub(super) fn permuted(&self, lane: usize, axes: [usize; 3]) -> [Vec3; 3] {
        let at = |corner: usize, axis: usize| self.corners[corner][axis][lane];
        core::array::from_fn(|k| Vec3::from_array(axes.map(|axis| at(k, axis))))
    }
}

/// Something that has a leaf to itself: a shape, or a placed mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Apart {
    /// Index of the object.
    pub(super) object: u32,
    /// Number within the object.
    pub(super) prim: u32,
}

/// A whole hierarchy; node 0 is the root. No nodes: nothing is in it.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Bvh {
    pub(super) nodes: Vec<Node>,
    /// The first leaves.
    pub(super) blocks: Vec<Block>,
    /// The leaves after those.
    pub(super) apart: Vec<Apart>,
    /// Nodes on the longest way from the root to a leaf.
    pub(super) depth: usize,
}

impl Bvh {
    /// Most children that wait at once on the way of a ray: all but one of each node.
    pub(super) fn stack_len(&self) -> usize {
        (WIDTH - 1) * self.depth
    }

    /// Which of `apart` is in a leaf, if it is one of those.
    #[inline]
    pub(super) fn apart_index(&self, leaf: Child) -> Option<usize> {
        leaf.leaf_index().checked_sub(self.blocks.len())
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..]) + size_of_val(&self.apart[..])
    }
}
