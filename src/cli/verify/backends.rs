//! The part that needs both backends.

use super::super::exit::{Exit, Failure};
use super::super::plan::Input;
use super::super::progress::Stage;
use super::super::render::build_failure;
use super::Run;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::scene::{CameraOverrides, Loaded, Scene, View};
use tison::verify::{Options, Report};

impl Run<'_, '_> {
    /// Over the scene as its first camera sees it, or framed and lit as a render would.
    pub fn compare_backends(&self, mut loaded: Loaded, size: (u32, u32), aimed: u64) -> Result<Report, Failure> {
        let scene = &mut loaded.scene;
        let aspect = f64::from(size.0) / f64::from(size.1);
        let camera = match loaded.cameras.first() {
            Some(named) => named.camera,
            None => scene
                .auto_camera(View::default(), &CameraOverrides::default(), aspect)
                .map_err(|e| Failure::new(Exit::Input, e))?,
        };
        if Input::of(&self.args.input) == Input::Mesh {
            scene.light_from(&camera);
        }
        self.progress.stage(Stage::Build);
        let (first, second) = (self.build(BackendKind::Embree, scene)?, self.build(BackendKind::Native, scene)?);
        let (AnyBackend::Embree(first), AnyBackend::Native(second)) = (&first, &second) else {
            unreachable!("they are of the kinds that were asked for")
        };
        self.progress.stage(Stage::Compare);
        let tell = |share: f64| self.progress.report(share);
        let options =
            Options { size, aimed, seed: self.args.seed, cancel: &self.control.cancel, progress: Some(&tell) };
        tison::verify::run(scene, &camera, (first, second), &options).map_err(|e| Failure::new(Exit::Input, e))
    }

    fn build(&self, kind: BackendKind, scene: &Scene) -> Result<AnyBackend, Failure> {
        let options = BuildOptions {
            threads: self.args.threads.map_or(0, usize::from),
            // Good hierarchies, as long renders have them.
            rays_expected: u64::MAX,
            cancel: &self.control.cancel,
            memory_limit: None,
            progress: None,
        };
        AnyBackend::build(kind, scene, &options).map_err(|e| build_failure(&e))
    }
}
