//! Which camera takes the picture: one of the scene file's, or one that frames the scene.

use super::args::CameraArgs;
use super::exit::{Exit, Failure};
use super::message::nearest;
use super::plan::Plan;
use super::settings::{Origin, Setting, Settings, origin_in_scene};
use super::turntable;
use glam::DVec3;
use std::path::Path;
use tison::scene::desc::NamedCamera;
use tison::scene::{CameraDesc, CameraOverrides, Loaded, Projection, View};

/// Most names that a message lists.
const FEW: usize = 12;

/// A camera and where it comes from.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The first, if there are many.
    pub camera: CameraDesc,
    /// What a turntable turns around.
    pub axis: DVec3,
    /// Where its parts come from.
    pub list: Vec<Setting>,
}

/// The view called `name`, of a scene that brings no camera.
pub fn view(flags: &CameraArgs) -> Result<View, Failure> {
    let Some(name) = flags.name.as_deref() else { return Ok(View::default()) };
    if flags.eye.is_some() {
        return Err(Failure::usage(format!("--camera {name} cannot be used with --eye: both say where the camera is")));
    }
    let known = View::ALL.iter().find(|(n, _)| *n == name);
    known
        .map(|(_, view)| *view)
        .ok_or_else(|| no_camera(name, "a scene without cameras has the views", &View::ALL.map(|(name, _)| name)))
}

fn no_camera(name: &str, there: &str, names: &[&str]) -> Failure {
    let more = if names.len() > FEW { ", …" } else { "" };
    let list = names[..names.len().min(FEW)].join(", ");
    let failure = Failure::usage(format!("no camera is called '{name}': {there} {list}{more}"));
    match nearest(name, names.iter().copied()) {
        Some(near) => failure.help(format!("did you mean '{near}'?")),
        None => failure,
    }
}

/// The camera for `loaded`.
pub fn choose(plan: &Plan, loaded: &Loaded, settings: &Settings) -> Result<Chosen, Failure> {
    let flags = &plan.camera;
    let chosen = if loaded.cameras.is_empty() {
        framed(plan, loaded, settings)?
    } else {
        let named = named(&loaded.cameras, flags.name.as_deref(), &plan.input)?;
        let camera = overridden(&named.camera, flags, settings);
        Chosen { camera, axis: camera.up, list: list_named(plan, named, &camera) }
    };
    check_focus(flags, chosen.camera.aperture)?;
    let ready = chosen.camera.prepare(&loaded.scene.frame, settings.job.size);
    ready.map_err(|e| Failure::new(if any_given(flags) { Exit::Usage } else { Exit::Input }, e))?;
    Ok(chosen)
}

/// `--focus` without a lens would change nothing.
pub fn check_focus(flags: &CameraArgs, aperture: f64) -> Result<(), Failure> {
    if flags.focus.is_some() && flags.aperture.is_none() && aperture == 0.0 {
        return Err(Failure::usage("--focus changes nothing without a lens: everything is sharp")
            .help("give its radius with --aperture"));
    }
    Ok(())
}

fn named<'a>(cameras: &'a [NamedCamera], name: Option<&str>, file: &Path) -> Result<&'a NamedCamera, Failure> {
    let Some(name) = name else { return Ok(&cameras[0]) };
    cameras.iter().find(|c| c.name == name).ok_or_else(|| {
        let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
        no_camera(name, &format!("{} has", file.display()), &names)
    })
}

/// `camera` with what the flags say instead.
///
/// Distances that the flags leave alone, the clipping ones among them, stay what they are. Where
/// the file gives the view an aspect of its own, it keeps the shape of a pixel: an image of another
/// shape than the file's shows more or less at its sides, never a squeezed picture.
fn overridden(camera: &CameraDesc, flags: &CameraArgs, settings: &Settings) -> CameraDesc {
    let shape = |(w, h): (u32, u32)| f64::from(w) / f64::from(h);
    let stretch = settings.scene_size.map_or(1.0, |size| shape(settings.job.size) / shape(size));
    CameraDesc {
        eye: flags.eye.unwrap_or(camera.eye),
        target: flags.target.unwrap_or(camera.target),
        up: flags.up.unwrap_or(camera.up),
        projection: flags.projection().unwrap_or(camera.projection),
        aperture: flags.aperture.unwrap_or(camera.aperture),
        focus: flags.focus.or(camera.focus),
        aspect: camera.aspect.map(|aspect| aspect * stretch),
        clip: camera.clip,
    }
}

fn framed(plan: &Plan, loaded: &Loaded, settings: &Settings) -> Result<Chosen, Failure> {
    let flags = &plan.camera;
    let given = flags.overrides();
    let (width, height) = settings.job.size;
    let aspect = f64::from(width) / f64::from(height);
    let view = view(flags)?;
    let at_fault = if any_given(flags) { Exit::Usage } else { Exit::Input };
    let mut camera = loaded.scene.auto_camera(view, &given, aspect).map_err(|e| Failure::new(at_fault, e))?;
    if flags.turntable.is_some() {
        camera = turntable::first(&camera, &given, loaded.scene.bounds(), aspect);
    }
    let name = View::ALL.iter().find(|(_, v)| *v == view).map_or("", |(name, _)| name);
    let origin = |given: bool| if given { Origin::Flag } else { Origin::Default };
    let mut list = vec![Setting { name: "camera", value: name.into(), origin: origin(flags.name.is_some()) }];
    if flags.eye.is_some() {
        list.clear();
    }
    list.extend(parts(&camera, flags, |_| Origin::Default));
    Ok(Chosen { camera, axis: flags.up.unwrap_or(DVec3::Y), list })
}

fn any_given(flags: &CameraArgs) -> bool {
    flags.name.is_some() || flags.overrides() != CameraOverrides::default()
}

fn list_named(plan: &Plan, named: &NamedCamera, camera: &CameraDesc) -> Vec<Setting> {
    let origin = if plan.camera.name.is_some() { Origin::Flag } else { Origin::Scene };
    let mut list = vec![Setting { name: "camera", value: named.name.clone(), origin }];
    let of_key = |key: &str| origin_in_scene(&plan.defines, &format!("camera.{}.{key}", named.name));
    list.extend(parts(camera, &plan.camera, of_key));
    list
}

/// Each part of a camera; `otherwise` tells by key who says what the flags do not.
fn parts(camera: &CameraDesc, flags: &CameraArgs, otherwise: impl Fn(&str) -> Origin) -> Vec<Setting> {
    let vector = |v: DVec3| format!("{},{},{}", v.x, v.y, v.z);
    let part = |name, value, given: bool, key: &str| {
        let origin = if given { Origin::Flag } else { otherwise(key) };
        Setting { name, value, origin }
    };
    let mut list = vec![
        part("eye", vector(camera.eye), flags.eye.is_some(), "eye"),
        part("target", vector(camera.target), flags.target.is_some(), "target"),
        part("up", vector(camera.up), flags.up.is_some(), "up"),
        match camera.projection {
            Projection::Perspective { fov_deg } => part("fov", fov_deg.to_string(), flags.fov.is_some(), "fov"),
            Projection::Orthographic { height } => part("ortho", height.to_string(), flags.ortho.is_some(), "height"),
        },
        part("aperture", camera.aperture.to_string(), flags.aperture.is_some(), "lens"),
    ];
    list.extend(camera.focus.map(|f| part("focus", f.to_string(), flags.focus.is_some(), "lens")));
    list.extend(camera.aspect.map(|a| part("aspect", a.to_string(), false, "aspect")));
    list.extend(camera.clip.map(|(near, far)| part("clip", format!("{near},{far}"), false, "clip")));
    list
}

impl CameraArgs {
    fn projection(&self) -> Option<Projection> {
        let perspective = self.fov.map(|fov_deg| Projection::Perspective { fov_deg });
        perspective.or(self.ortho.map(|height| Projection::Orthographic { height }))
    }

    /// The flags as framing takes them.
    fn overrides(&self) -> CameraOverrides {
        CameraOverrides {
            eye: self.eye,
            target: self.target,
            up: self.up,
            projection: self.projection(),
            aperture: self.aperture,
            focus: self.focus,
        }
    }
}

#[cfg(test)]
mod tests;
