//! Builds the hierarchy from the top down: binned surface-area heuristic.
//!
//! Source: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies",
//! RT 2007; four children at once by splitting the largest of them again, as Embree does.
//! Every decision depends on the boxes alone, so the tree is the same for any number
//! of threads.

use super::bins::{BINS, Binning, Bins, Box4, Item, Plane};
use super::bvh::{Apart, Block, Bvh, Child, HEURISTIC_DEPTH, MAX_THINGS, Node, WIDTH};
use super::held::Held;
use super::{BuildError, BuildOptions, Quality};
use crate::geom::{BAD_FACE, Bounds, ShapeSet, TriangleMesh};
use crate::scene::AnyShapes;
use crate::with_shapes;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Below this many things a subtree is built by one thread.
const TASK: usize = 1 << 12;

/// Above this many things they are counted into bins by several threads.
const WIDE: usize = 1 << 16;

/// An object as the builder sees it: boxes.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// Four faces may share a leaf.
    Mesh(&'a TriangleMesh),
    /// Each shape has a leaf to itself.
    Shapes(&'a AnyShapes),
    /// One leaf for all of it; an empty box is left out.
    Whole(Bounds),
}

/// Things that stay together, with the box around them and the one around their
/// centroids.
struct Group<'a> {
    items: &'a mut [Item],
    /// Place of the first item among all.
    start: usize,
    bounds: Box4,
    centroids: Box4,
}

/// Things of one leaf among all items.
#[derive(Clone, Copy)]
struct LeafRange {
    start: u32,
    count: u32,
}

/// A finished subtree: node 0 is its root, leaves are numbered within it.
#[derive(Default)]
struct Subtree {
    nodes: Vec<Node>,
    leaves: Vec<LeafRange>,
    depth: usize,
}

/// What a child of a node is while threads still work on subtrees.
enum Part {
    Leaf(LeafRange),
    Done(Subtree),
    Inner(Node, Vec<Part>),
}

struct Builder<'a> {
    quality: Quality,
    cancel: &'a AtomicBool,
    held: &'a Held,
}

/// Number of the first thing of each source: all are counted through.
pub(super) fn numbers(sources: &[Source<'_>]) -> Result<Vec<u32>, BuildError> {
    let mut next = 0;
    let first = sources.iter().map(|source| {
        let first = next as u32;
        next += source.len();
        first
    });
    let first = first.collect();
    if next > MAX_THINGS { Err(BuildError::TooMany { count: next }) } else { Ok(first) }
}

/// `(index of the source, number within it)` of the thing with number `id`.
#[inline]
pub(super) fn owner(first: &[u32], id: u32) -> (u32, u32) {
    let source = first.partition_point(|&f| f <= id) - 1;
    (source as u32, id - first[source])
}

/// Builds the hierarchy over all that can be hit; `first` is their [`numbers`].
///
/// What it takes is counted in `held`, and what it gives back, but for the hierarchy itself.
pub(super) fn build(
    sources: &[Source<'_>],
    first: &[u32],
    options: &BuildOptions<'_>,
    held: &Held,
) -> Result<Bvh, BuildError> {
    let builder = Builder { quality: options.quality, cancel: options.cancel, held };
    let for_items = sources.iter().map(Source::len).sum::<usize>() * size_of::<Item>();
    held.take(for_items)?;
    let mut items = items(sources, first);
    let mut tree = builder.tree(&mut items)?;
    let items_of = |leaf: &LeafRange| &items[leaf.start as usize..][..leaf.count as usize];
    let is_apart = |leaf: &LeafRange| items_of(leaf)[0].is_apart();
    let block = |leaf: &LeafRange| {
        let mut block = Block::EMPTY;
        for (lane, item) in items_of(leaf).iter().enumerate() {
            let (source, prim) = owner(first, item.id());
            if let Source::Mesh(mesh) = sources[source as usize] {
                block.set(lane, mesh.triangle(prim), item.id());
            }
        }
        block
    };
    let apart = |leaf: &LeafRange| {
        let (object, prim) = owner(first, items_of(leaf)[0].id());
        Apart { object, prim }
    };
    let only_meshes = sources.iter().all(|s| matches!(s, Source::Mesh(_)));
    let at = if only_meshes { tree.leaves.len() } else { tree.blocks_first(is_apart) };
    // Joining took as much memory again, and the leaves are still to come.
    builder.check()?;
    let (blocks, others) = tree.leaves.split_at(at);
    held.take(blocks.len() * size_of::<Block>() + others.len() * size_of::<Apart>())?;
    let blocks = blocks.par_iter().with_min_len(TASK).map(block).collect();
    let apart = others.par_iter().with_min_len(TASK).map(apart).collect();
    held.give(for_items + size_of_val(&tree.leaves[..]));
    Ok(Bvh { nodes: tree.nodes, blocks, apart, depth: tree.depth })
}

impl Source<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.face_count(),
            Self::Shapes(set) => set.len() as usize,
            Self::Whole(_) => 1,
        }
    }
}

/// Boxes of all that can be hit, in the order of their numbers.
fn items(sources: &[Source<'_>], first: &[u32]) -> Vec<Item> {
    let mut items = Vec::with_capacity(sources.iter().map(Source::len).sum());
    for (source, &first) in sources.iter().zip(first) {
        match source {
            Source::Mesh(mesh) => {
                items.par_extend(mesh.faces().par_iter().enumerate().with_min_len(TASK).filter_map(|(i, &face)| {
                    let prim = i as u32;
                    (face != BAD_FACE).then(|| Item::triangle(mesh.triangle(prim), first + prim))
                }));
            }
            Source::Shapes(set) => {
                let item = |prim| Item::apart(&with_shapes!(set, set => set.bounds(prim)), first + prim);
                items.par_extend((0..set.len()).into_par_iter().with_min_len(TASK).map(item));
            }
            Source::Whole(bounds) if bounds.is_empty() => {}
            Source::Whole(bounds) => items.push(Item::apart(bounds, first)),
        }
    }
    items
}

impl Builder<'_> {
    fn tree(&self, items: &mut [Item]) -> Result<Subtree, BuildError> {
        if items.is_empty() {
            return Ok(Subtree::default());
        }
        let root = Group::of(items);
        let mut tree = Subtree::default();
        if root.items.len() <= TASK {
            self.subtree(root, 1, &mut tree)?;
            self.held.take(tree.bytes())?;
            return Ok(tree);
        }
        let part = self.part(root, 1)?;
        // The parts go one by one as they are joined, but what they had may stay with the process until all have gone.
        let bytes = part.bytes();
        self.held.take(bytes)?;
        tree.take(part, 1);
        self.held.give(bytes);
        Ok(tree)
    }

    /// Builds what is below a node at `depth`, large subtrees in parallel.
    fn part(&self, group: Group<'_>, depth: usize) -> Result<Part, BuildError> {
        if group.is_leaf() {
            self.held.take(size_of::<LeafRange>())?;
            return Ok(Part::Leaf(group.leaf()));
        }
        if group.items.len() <= TASK {
            let mut tree = Subtree::default();
            self.subtree(group, depth, &mut tree)?;
            self.held.take(tree.bytes())?;
            return Ok(Part::Done(tree));
        }
        self.check()?;
        let children = self.children(group, depth);
        let mut node = Node::EMPTY;
        for (lane, child) in children.iter().enumerate() {
            node.set_bounds(lane, child.bounds);
        }
        self.held.take(size_of::<Node>())?;
        let parts: Result<Vec<_>, _> = children.into_par_iter().map(|c| self.part(c, depth + 1)).collect();
        Ok(Part::Inner(node, parts?))
    }

    /// Builds a node for `group` and all below it, depth first.
    fn subtree(&self, group: Group<'_>, depth: usize, out: &mut Subtree) -> Result<(), BuildError> {
        self.check()?;
        let index = out.nodes.len();
        out.nodes.push(Node::EMPTY);
        out.depth = out.depth.max(depth);
        let children = if group.is_leaf() { vec![group] } else { self.children(group, depth) };
        for (lane, child) in children.into_iter().enumerate() {
            out.nodes[index].set_bounds(lane, child.bounds);
            out.nodes[index].child[lane] = if child.is_leaf() {
                out.leaf(child.leaf())
            } else {
                let node = Child::node(out.nodes.len());
                self.subtree(child, depth + 1, out)?;
                node
            };
        }
        Ok(())
    }

    fn check(&self) -> Result<(), BuildError> {
        if self.cancel.load(Ordering::Relaxed) { Err(BuildError::Cancelled) } else { Ok(()) }
    }

    /// Splits the group with the largest box until there are four, or only leaves.
    fn children<'a>(&self, group: Group<'a>, depth: usize) -> Vec<Group<'a>> {
        let unit = group.bounds.unit();
        let mut children = Vec::with_capacity(WIDTH);
        children.push(group);
        while children.len() < WIDTH {
            let areas = children.iter().enumerate().filter(|(_, c)| !c.is_leaf());
            let areas = areas.map(|(i, c)| (i, c.bounds.half_area(unit)));
            let Some((largest, _)) = areas.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            let (left, right) = self.split(children.swap_remove(largest), depth);
            children.push(left);
            children.push(right);
        }
        children
    }

    /// Two groups, neither empty.
    fn split<'a>(&self, group: Group<'a>, depth: usize) -> (Group<'a>, Group<'a>) {
        let plane = match self.quality {
            _ if depth >= HEURISTIC_DEPTH => None,
            Quality::Good => cheapest_plane(&group),
            Quality::Fast => Plane::through_middle(group.centroids),
        };
        match plane {
            Some(plane) => group.partition(&plane),
            None => group.halve(),
        }
    }
}

/// Where the surface-area heuristic splits; `None` where all centroids coincide.
fn cheapest_plane(group: &Group<'_>) -> Option<Plane> {
    let binning = Binning::new(group.centroids, (4 + group.items.len() / 8).min(BINS));
    let bins = if group.items.len() > WIDE {
        let parts = group.items.par_chunks(TASK).map(|chunk| Bins::of(chunk, &binning));
        parts.reduce(|| Bins::EMPTY, Bins::plus)
    } else {
        Bins::of(group.items, &binning)
    };
    bins.best(&binning, group.bounds.unit())
}

impl Part {
    /// Bytes that it becomes.
    fn bytes(&self) -> usize {
        match self {
            Self::Leaf(_) => size_of::<LeafRange>(),
            Self::Done(tree) => tree.bytes(),
            Self::Inner(_, parts) => size_of::<Node>() + parts.iter().map(Self::bytes).sum::<usize>(),
        }
    }
}

impl Subtree {
    fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }

    /// Gives the leaves for which `is_apart` the highest numbers; the first of those.
    fn blocks_first(&mut self, is_apart: impl Fn(&LeafRange) -> bool + Sync + Send) -> usize {
        let is_apart: Vec<bool> = self.leaves.par_iter().with_min_len(TASK).map(is_apart).collect();
        let blocks = is_apart.iter().filter(|&&apart| !apart).count();
        let mut next = [0, blocks];
        let take = |&apart: &bool| {
            next[usize::from(apart)] += 1;
            next[usize::from(apart)] - 1
        };
        let places: Vec<usize> = is_apart.iter().map(take).collect();
        let from = self.leaves.clone();
        for (leaf, &place) in from.iter().zip(&places) {
            self.leaves[place] = *leaf;
        }
        self.nodes.par_iter_mut().with_min_len(TASK).for_each(|node| {
            for child in node.child.iter_mut().filter(|c| c.is_leaf() && **c != Child::NONE) {
                *child = Child::leaf(places[child.leaf_index()], child.lanes().count_ones() as usize);
            }
        });
        blocks
    }

    /// Appends a leaf and says how a node refers to it.
    fn leaf(&mut self, leaf: LeafRange) -> Child {
        self.leaves.push(leaf);
        Child::leaf(self.leaves.len() - 1, leaf.count as usize)
    }

    /// Appends `part`, whose top is at `depth`, and says how a node refers to it.
    fn take(&mut self, part: Part, depth: usize) -> Child {
        let base = self.nodes.len();
        match part {
            Part::Leaf(leaf) => return self.leaf(leaf),
            Part::Done(tree) => {
                let leaves = self.leaves.len();
                let moved = |n: Node| Node { child: n.child.map(|c| c.moved(base, leaves)), ..n };
                self.nodes.extend(tree.nodes.into_iter().map(moved));
                self.leaves.extend(tree.leaves);
                self.depth = self.depth.max(tree.depth);
            }
            Part::Inner(node, parts) => {
                self.nodes.push(node);
                self.depth = self.depth.max(depth);
                for (lane, part) in parts.into_iter().enumerate() {
                    self.nodes[base].child[lane] = self.take(part, depth + 1);
                }
            }
        }
        Child::node(base)
    }
}

impl<'a> Group<'a> {
    /// All items.
    fn of(items: &'a mut [Item]) -> Self {
        let (bounds, centroids) = items
            .par_chunks(TASK)
            .map(|chunk| {
                let mut boxes = (Box4::EMPTY, Box4::EMPTY);
                for item in chunk {
                    boxes.0.grow(item.lo(), item.hi);
                    boxes.1.grow(item.centroid(), item.centroid());
                }
                boxes
            })
            .reduce(|| (Box4::EMPTY, Box4::EMPTY), |a, b| (a.0.union(b.0), a.1.union(b.1)));
        Self { items, start: 0, bounds, centroids }
    }

    fn is_leaf(&self) -> bool {
        self.items.len() <= if self.bounds.shares() { WIDTH } else { 1 }
    }

    fn leaf(&self) -> LeafRange {
        LeafRange { start: self.start as u32, count: self.items.len() as u32 }
    }

    /// Sorts the items to the two sides of `plane`.
    fn partition(self, plane: &Plane) -> (Self, Self) {
        let items = self.items;
        let mut left = (Box4::EMPTY, Box4::EMPTY);
        let mut right = left;
        let (mut i, mut j) = (0, items.len());
        while i < j {
            let item = items[i];
            let c = item.centroid();
            let side = if plane.is_left(c) {
                i += 1;
                &mut left
            } else {
                j -= 1;
                items.swap(i, j);
                &mut right
            };
            side.0.grow(item.lo(), item.hi);
            side.1.grow(c, c);
        }
        let (a, b) = items.split_at_mut(i);
        let (start, mid) = (self.start, self.start + i);
        (
            Self { items: a, start, bounds: left.0, centroids: left.1 },
            Self { items: b, start: mid, bounds: right.0, centroids: right.1 },
        )
    }

    /// Two halves by the order of centroids along the longest axis.
    fn halve(self) -> (Self, Self) {
        let axis = self.centroids.longest_axis();
        let mid = self.items.len() / 2;
        let key = |item: &Item| (item.centroid()[axis], item.id());
        self.items.select_nth_unstable_by(mid, |a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        });
        let (a, b) = self.items.split_at_mut(mid);
        let (mut left, mut right) = (Group::of(a), Group::of(b));
        left.start = self.start;
        right.start = self.start + mid;
        (left, right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::native::bvh::MAX_DEPTH;
    use crate::backend::native::traverse::SMALL_STACK;
    use glam::Vec3;
    use rayon::ThreadPoolBuilder;

    static NEVER: AtomicBool = AtomicBool::new(false);

    fn built(mesh: &TriangleMesh, quality: Quality) -> Bvh {
        let options = BuildOptions { quality, cancel: &NEVER, memory_limit: None };
        let held = Held::new(None);
        let bvh = build(&[Source::Mesh(mesh)], &[0], &options, &held).expect("never cancelled");
        held.give(bvh.bytes());
        assert_eq!(held.now(), 0, "what is left is the hierarchy");
        bvh
    }

    fn soup(triangles: impl Iterator<Item = [Vec3; 3]>) -> TriangleMesh {
        let points: Vec<f32> = triangles.flatten().flat_map(|p| p.to_array()).collect();
        let faces = (0..points.len() as u32 / 9).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        TriangleMesh::new(points, faces)
    }

    /// Small triangles along a spiral.
    fn spiral(n: u32) -> TriangleMesh {
        soup((0..n).map(|i| {
            let a = i as f32 * 0.37;
            let p = Vec3::new(a.cos(), a.sin(), 1e-4 * i as f32) * (1.0 + (1.7 * a).sin());
            [p, p + Vec3::new(0.01, 0.02, 0.0), p + Vec3::new(0.0, 0.01, 0.03)]
        }))
    }

    /// Each triangle is 1.5 times the size of the one before: planes at equal distances
    /// peel off a few at a time.
    fn growing(n: i32) -> TriangleMesh {
        soup((0..n).map(|i| {
            let s = 1.5f32.powi(i % 200 - 100) * (1.0 + 0.001 * (i / 200) as f32);
            [Vec3::splat(s), Vec3::new(2.0 * s, s, s), Vec3::new(s, 2.0 * s, s)]
        }))
    }

    /// Counts each triangle, and checks that the boxes above hold it with room to spare.
    fn visit(bvh: &Bvh, child: Child, (lo, hi): (Vec3, Vec3), depth: usize, seen: &mut [u32]) -> usize {
        if child.is_leaf() {
            let block = &bvh.blocks[child.leaf_index()];
            for lane in (0..WIDTH).filter(|lane| child.lanes() >> lane & 1 == 1) {
                seen[block.id[lane] as usize] += 1;
                for p in block.triangle(lane) {
                    assert!(p.cmpgt(lo).all() && p.cmplt(hi).all());
                }
            }
            return depth;
        }
        let node = &bvh.nodes[child.node_index()];
        let lanes = (0..WIDTH).filter(|&lane| node.child[lane] != Child::NONE);
        let below = lanes.map(|lane| {
            let side = |side: usize| Vec3::from([0, 1, 2].map(|axis| node.bounds[axis][side][lane]));
            let inner = (side(0).max(lo), side(1).min(hi));
            visit(bvh, node.child[lane], inner, depth + 1, seen)
        });
        below.max().expect("a node has children")
    }

    #[test]
    fn every_triangle_is_in_one_leaf_inside_all_boxes_above() {
        let meshes = [spiral(1), spiral(4), spiral(5), spiral(77), spiral(30_000), growing(9000)];
        for (mesh, quality) in meshes.iter().flat_map(|m| [(m, Quality::Good), (m, Quality::Fast)]) {
            let bvh = built(mesh, quality);
            let mut seen = vec![0; mesh.face_count()];
            let all = (Vec3::NEG_INFINITY, Vec3::INFINITY);
            assert_eq!(visit(&bvh, Child::ROOT, all, 0, &mut seen), bvh.depth);
            assert!(seen.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn the_tree_is_the_same_for_any_number_of_threads() {
        let mesh = spiral(3 * WIDE as u32 / 2);
        for quality in [Quality::Good, Quality::Fast] {
            let [one, two, seven] = [1, 2, 7].map(|threads| {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| built(&mesh, quality))
            });
            assert!(one == two && one == seven, "{quality:?}");
        }
    }

    #[test]
    fn a_tree_deeper_than_the_small_stack_stays_below_the_limit() {
        let bvh = built(&growing(9000), Quality::Fast);
        assert!(bvh.stack_len() > SMALL_STACK && bvh.depth <= MAX_DEPTH, "{}", bvh.depth);
    }
}
