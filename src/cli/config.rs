//! `--print-config`: what decides the picture and the run, and who says so.

use super::args::RenderArgs;
use super::plan::Plan;
use super::render::Ready;
use super::settings::{Origin, Setting, origin_in_scene};
use std::fmt::Write;
use tison::scene::Loaded;
use tison::scene::obj::Reader;

/// What the flags say about the run, none of which changes the picture but `smooth`.
pub fn of_run(args: &RenderArgs, plan: &Plan) -> Vec<Setting> {
    let origin = |given: bool| if given { Origin::Flag } else { Origin::Default };
    let setting = |name, value: String, given| Setting { name, value, origin: origin(given) };
    let given = |name, value: String| setting(name, value, true);
    let mut list: Vec<Setting> =
        plan.outputs.iter().map(|o| setting("output", o.target.name(), !args.output.is_empty())).collect();
    list.extend(plan.aovs.iter().map(|a| given("aov", a.name().into())));
    list.extend(plan.stats.iter().map(|t| given("stats", t.name())));
    list.push(setting("backend", plan.backend.name().into(), args.backend.is_some()));
    list.push(setting("threads", plan.threads.to_string(), args.threads.is_some()));
    list.extend(plan.max_memory.map(|bytes| given("max-memory", bytes.to_string())));
    list.push(setting("obj-reader", plan.reader.name().into(), plan.reader != Reader::default()));
    list.extend(plan.smooth.map(|angle| given("smooth", angle.to_string())));
    list.extend(plan.camera.turntable.map(|n| given("turntable", n.to_string())));
    list.extend(plan.allow.iter().map(|dir| given("allow-path", dir.display().to_string())));
    list.extend(plan.skips.off().map(|skip| given("no-skip", skip.name().into())));
    list.extend(plan.defines.iter().map(|define| given("-D", define.clone())));
    list
}

/// Name, value, origin: one line a setting.
pub fn text(plan: &Plan, ready: &Ready) -> String {
    let colours = colours(plan, &ready.loaded);
    let list: Vec<&Setting> =
        [&ready.settings.list[..], &colours, &ready.chosen.list, &plan.list].into_iter().flatten().collect();
    let widest = |of: fn(&Setting) -> usize| list.iter().map(|s| of(s)).max().unwrap_or(0);
    let (names, values) = (widest(|s| s.name.len()), widest(|s| s.value.chars().count()).min(40));
    let mut out = format!("{}\n", plan.input.display());
    for Setting { name, value, origin } in list {
        // Writing to a string does not fail.
        let _ = writeln!(out, "  {name:names$}  {value:values$}  {origin}");
    }
    out
}

/// What the scene file alone can say.
fn colours(plan: &Plan, loaded: &Loaded) -> [Setting; 2] {
    let (scene, render) = (&loaded.scene, &loaded.render);
    let colour = |name, key: &str, c: glam::Vec3, said: bool| {
        let origin = if said { origin_in_scene(&plan.defines, key) } else { Origin::Default };
        Setting { name, value: format!("{},{},{}", c.x, c.y, c.z), origin }
    };
    [
        colour("background", "render.background", scene.background, render.background.is_some()),
        colour("ambient", "render.ambient", scene.ambient, render.ambient.is_some()),
    ]
}
