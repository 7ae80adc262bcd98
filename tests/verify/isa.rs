//! Embree in every instruction set that this processor has, robust and not, against native.

use super::{assert_explained, few, native, of_project};
use std::sync::Arc;
use tison::backend::Backend;
use tison::embree::{self, Device, DeviceConfig, SceneBuilder, SceneOptions};
use tison::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket};
use tison::scene::{Object, Scene};
use tison::verify::{Class, run};
use tison::with_shapes;

/// Embree's scene, built here so that everything about it can be chosen.
struct Chosen(embree::Scene);

impl Backend for Chosen {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.0.intersect(ray)
    }
    fn occluded(&self, ray: &Ray) -> bool {
        self.0.occluded(ray)
    }
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.0.intersect_batch(rays, coherence);
    }
    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        self.0.occluded_batch(rays, coherence);
    }
}

fn build(device: &Device, scene: &Scene, robust: bool) -> Chosen {
    let builder = || SceneBuilder::new(device, SceneOptions { robust, ..SceneOptions::default() }).expect("memory");
    let mut whole = builder();
    for object in &scene.objects {
        let added = match object {
            Object::Mesh(mesh) => whole.mesh(Arc::clone(&mesh.data.triangles)),
            Object::Shapes(shapes) => with_shapes!(&shapes.set, set => whole.shapes(Arc::clone(set))),
            Object::Instance(i) => {
                let mut child = builder();
                child.mesh(Arc::clone(&i.mesh.data.triangles)).expect("a mesh");
                whole.instance(Arc::new(child.commit(None).expect("memory")), &i.to_scene)
            }
        };
        added.expect("a good object");
    }
    Chosen(whole.commit(None).expect("memory"))
}

/// All of them that the processor has, by Embree's own word.
fn devices() -> Vec<(&'static str, Device)> {
    let isas = ["sse2", "sse4.2", "avx", "avx2", "avx512"];
    let open = |isa| Device::new(&DeviceConfig { threads: 1, isa: Some(isa), ..Default::default() }).ok();
    isas.into_iter().filter_map(|isa| Some((isa, open(isa)?))).collect()
}

#[test]
fn every_instruction_set_agrees_with_native() {
    let devices = devices();
    assert!(devices.iter().any(|(isa, _)| *isa == "sse2"), "every x86-64 has that");
    for name in ["mesh.toml", "instances.toml", "transform.toml", "thousand_spheres.toml"] {
        let (scene, camera) = of_project(name);
        let native = native(&scene);
        for (isa, device) in &devices {
            for robust in [true, false] {
                let chosen = build(device, &scene, robust);
                let report = run(&scene, &camera, (&chosen, &*native), &few(5)).expect("a good camera");
                assert_explained(&report, &scene, &format!("{name}, {isa}, robust {robust}"));
            }
        }
    }
}

#[test]
fn what_is_not_robust_loses_more_at_edges() {
    let (scene, camera) = of_project("smooth_normals.toml");
    let native = native(&scene);
    let device = Device::new(&DeviceConfig { threads: 1, ..Default::default() }).expect("Embree is there");
    let edges = |robust| {
        let report = run(&scene, &camera, (&build(&device, &scene, robust), &*native), &few(5)).expect("a good camera");
        assert_explained(&report, &scene, &format!("robust {robust}"));
        report.total().of(Class::Edge)
    };
    let (robust, not) = (edges(true), edges(false));
    assert!(not > robust, "{not} without, {robust} with");
}
