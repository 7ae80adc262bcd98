//! What a run left out, and what was switched off so that it was not.

use super::report::Report;
use tison::scene::{SceneCounts, Skip};

/// Why something was not done.
#[derive(Debug, PartialEq)]
pub enum Skipped {
    /// That often.
    Count(u64),
    /// At all.
    Because(&'static str),
}

/// What `--no-skip` leaves in its place.
const OFF: &str = "off (--no-skip)";

/// Names here of what a skip leaves out.
fn names(skip: Skip) -> &'static [&'static str] {
    match skip {
        Skip::UnusedAssets => &["unused_textures"],
        Skip::Uv => &["texture_coordinates"],
        Skip::Normals => &["smooth_normals"],
        Skip::Lens => &["lens"],
        Skip::Jitter => &["pixel_jitter"],
        Skip::DarkLights => &["lights_without_power"],
        Skip::ShadowRays => &["shadow_rays_facing_away", "shadow_rays"],
        Skip::Enclosed => &["shadow_rays_enclosed"],
        Skip::FaintLights => &["shadow_rays_faint"],
        Skip::Inside => &["traversals_inside_shapes"],
        Skip::AnyHit => &["nearest_occluders"],
        Skip::Powf => &["blocks_without_highlight", "specular"],
        Skip::Secondary => &["secondary_stage"],
        Skip::WeightCut => &["branches_below_cut"],
        Skip::Bounds => &["packets_outside_bounds"],
        Skip::Aovs => &["auxiliary_buffers"],
        Skip::Converged => &["pixels_that_need_no_more"],
        Skip::Geometry => &["user_geometry", "meshes"],
        Skip::BuildQuality => &["good_build"],
        Skip::Fresnel => &["fresnel_between_equals"],
    }
}

/// What follows from the rest, and is told with -v only.
pub fn is_detail(name: &str) -> bool {
    ["texture_coordinates", "nearest_occluders", "secondary_stage", "auxiliary_buffers", "blocks_without_highlight"]
        .contains(&name)
}

/// What was left out, by name, and what was not because that is switched off.
pub fn skipped(report: &Report<'_>) -> Vec<(&'static str, Skipped)> {
    let skips = report.settings.job.skips;
    let off: Vec<&str> = skips.off().flat_map(names).copied().collect();
    let mut left_out = unneeded(report);
    left_out.extend(not_drawn(report));
    left_out.extend(kinds_without(&report.counts));
    left_out.extend(not_done(report));
    left_out.extend(counted(report));
    left_out.retain(|(name, _)| !off.contains(name));
    left_out.extend(off.iter().map(|&name| (name, Skipped::Because(OFF))));
    left_out
}

fn unneeded(report: &Report<'_>) -> Vec<(&'static str, Skipped)> {
    let unneeded = report.needs.iter().filter(|(_, needed)| !needed).map(|&(name, _)| {
        let why = match name {
            "reflection" => "no material mirrors",
            "refraction" => "no material refracts",
            "specular" => "no material has a highlight",
            "smooth_normals" => "no mesh has normals",
            "textures" => "no material has an image",
            "area_lights" => "no light has a size",
            "absorption" => "no material absorbs",
            "shadow_rays" => "no light changes any material",
            _ => "not needed",
        };
        (name, Skipped::Because(why))
    });
    unneeded.collect()
}

/// Ways that were not gone at all.
fn not_done(report: &Report<'_>) -> impl Iterator<Item = (&'static str, Skipped)> {
    let needs = |name| report.needs.contains(&(name, true));
    let parts = [
        ("texture_coordinates", report.counts.triangles > 0 && !needs("textures"), "no material has an image"),
        ("nearest_occluders", report.done.stats.rays.shadow > 0, "shadow rays stop at the first thing in the way"),
        ("secondary_stage", !needs("reflection") && !needs("refraction"), "no material mirrors or refracts"),
        ("auxiliary_buffers", report.settings.job.aovs.is_empty(), "no auxiliary image was asked for"),
        ("good_build", report.quick, "few rays: a quick hierarchy is the better deal"),
    ];
    parts.into_iter().filter(|&(_, left_out, _)| left_out).map(|(name, _, why)| (name, Skipped::Because(why)))
}

fn counted(report: &Report<'_>) -> impl Iterator<Item = (&'static str, Skipped)> {
    let (unused, stats) = (&report.unused, &report.done.stats);
    let counts = [
        ("unused_materials", unused.materials as u64),
        ("unused_textures", unused.textures as u64),
        ("lights_without_power", unused.lights as u64),
        ("fresnel_between_equals", report.fresnel as u64),
        ("packets_outside_bounds", stats.packets_outside),
        ("shadow_rays_facing_away", stats.shadow_rays_facing_away),
        ("shadow_rays_enclosed", stats.shadow_rays_enclosed),
        ("shadow_rays_faint", stats.shadow_rays_faint),
        ("traversals_inside_shapes", stats.rays_inside),
        ("blocks_without_highlight", stats.blocks_without_highlight),
        ("branches_below_cut", stats.branches_below_cut),
        ("pixels_that_need_no_more", stats.adapted.map_or(0, |a| a.stopped_early)),
    ];
    counts.into_iter().filter(|&(_, n)| n > 0).map(|(name, n)| (name, Skipped::Count(n)))
}

/// Random numbers that no ray needs.
fn not_drawn(report: &Report<'_>) -> impl Iterator<Item = (&'static str, Skipped)> {
    let job = &report.settings.job;
    let jitter = match (job.spp, job.jitter_radius) {
        (1, _) => Some("one sample a pixel"),
        (_, 0.0) => Some("all samples go through the pixel's centre"),
        _ => None,
    };
    let lens = (report.camera.aperture == 0.0).then_some("no lens: pinhole");
    let parts = [("lens", lens), ("pixel_jitter", jitter)];
    parts.into_iter().filter_map(|(name, why)| Some((name, Skipped::Because(why?))))
}

/// What no ray is tested against.
fn kinds_without(c: &SceneCounts) -> impl Iterator<Item = (&'static str, Skipped)> + use<> {
    let parts = [
        ("user_geometry", c.spheres + c.cubes + c.cylinders + c.quads, "no analytic shapes"),
        ("meshes", c.triangles, "no meshes"),
    ];
    parts.into_iter().filter(|&(_, n, _)| n == 0).map(|(name, _, why)| (name, Skipped::Because(why)))
}
