//! Surface points of hits by themselves: what a render would shade.

use super::block::{Block, Hits};
use super::facets::Facets;
use super::paint::Palette;
use super::shapes::ShapeHits;
use super::surface::SurfacePoint;
use crate::geom::{INVALID_ID, LANES, RayHitPacket};
use crate::scene::{Object, Scene};

/// Makes surface points of hits, by the code that renders. Kept and reused: it holds buffers.
#[derive(Debug)]
pub struct Surfaces<'a> {
    scene: &'a Scene,
    palette: Palette,
    facets: Box<Facets<'a>>,
    shapes: Box<ShapeHits>,
    block: Box<Block>,
}

impl<'a> Surfaces<'a> {
    /// For the hits of rays in `scene`.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let palette = Palette::of(scene);
        let (facets, shapes) = (Box::new(Facets::new(scene)), Box::default());
        Self { scene, palette, facets, shapes, block: Box::new(Block::EMPTY) }
    }

    /// The point of each of the first `live` lanes that hit.
    ///
    /// # Panics
    /// If a hit names a primitive that the scene does not have.
    pub fn of(&mut self, packet: &RayHitPacket, live: usize) -> [Option<SurfacePoint>; LANES] {
        let mut points = [None; LANES];
        let is_shape = |lane: usize| {
            let geom = packet.hit.geom_id[lane];
            (geom != INVALID_ID).then(|| matches!(self.scene.objects[geom as usize], Object::Shapes(_)))
        };
        let lanes = |shape: bool| (0..live).filter(move |&lane| is_shape(lane) == Some(shape));
        let hits: &mut dyn Hits = &mut *self.facets;
        finish(hits, lanes(false), packet, self.scene, &self.palette, &mut self.block, &mut points);
        let hits: &mut dyn Hits = &mut *self.shapes;
        finish(hits, lanes(true), packet, self.scene, &self.palette, &mut self.block, &mut points);
        points
    }
}

fn finish(
    hits: &mut dyn Hits,
    lanes: impl Iterator<Item = usize>,
    packet: &RayHitPacket,
    scene: &Scene,
    palette: &Palette,
    block: &mut Block,
    points: &mut [Option<SurfacePoint>; LANES],
) {
    let mut from = [0; LANES];
    let mut len = 0;
    for lane in lanes {
        hits.set(len, packet, lane);
        block.id[len] = [packet.hit.geom_id[lane], packet.hit.prim_id[lane]];
        from[len] = lane;
        len += 1;
    }
    if len == 0 {
        return;
    }
    hits.finish(len, scene, palette, block);
    for (lane, &from) in from[..len].iter().enumerate() {
        points[from] = Some(SurfacePoint::of_lane(block, lane));
    }
}
