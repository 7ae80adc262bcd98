//! What is read of images and libraries, and how it is shown.

use crate::kit::*;
use glam::{Vec2, Vec3};
use tison::scene::{Loaded, Material, MeshPaint, Unused};

#[test]
fn nothing_that_is_unused_is_read() {
    let text = "
        [material.used]
        color = [1, 0, 0]
        [material.spare]
        texture = 'not there.png'
        [material.flat]
        texture = 'not there either.png'
        diffuse = [1, 1, 1]
        ambient = 0
        [[object]]
        shape = 'quad'
        material = 'flat'
        [[object]]
        shape = 'quad'
        material = 'used'
        [[object]]
        mesh = 'a.obj'
        material = 'used'";
    let files = [("a.obj", &*format!("mtllib not there.mtl\nusemtl x\nvt 0 0\n{}", TRIANGLE.replace("f 1", "f 1/1")))];
    let loaded = scene(text, &files);
    assert_eq!(loaded.unused, Unused { materials: 1, textures: 2, lights: 0 });
    assert_eq!(loaded.warnings, []);
    let names: Vec<_> = loaded.scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["flat", "used"]);
    assert!(loaded.scene.textures.is_empty() && loaded.scene.materials.iter().all(|m| m.texture.is_none()));
    let mesh = mesh(&loaded, 1);
    assert!(mesh.data.uvs.is_none() && mesh.data.face_materials.is_none());
    assert_eq!(mesh.paint, MeshPaint::One(1));
}

/// A quad with the image the right way up, as OBJ files have it: v upwards.
const PICTURE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

/// What the texture of object 0 shows at the share (x, y) of the picture, from the bottom left.
fn seen(loaded: &Loaded, x: f32, y: f32) -> Vec3 {
    let mesh = mesh(loaded, 0);
    let corners = [[0, 1, 2], [0, 2, 3]].map(|c| c.map(|i| Vec2::new(f32::from(i == 1 || i == 2), f32::from(i > 1))));
    let t = usize::from(y > x);
    let [a, b, c] = mesh.data.uvs_of(t as u32).expect("it has texture coordinates");
    // Barycentrics of the point in the unit square's triangles.
    let (u, v) = if t == 0 { (x - y, y) } else { (x, y - x) };
    assert_eq!(corners[t][0] * (1.0 - u - v) + corners[t][1] * u + corners[t][2] * v, Vec2::new(x, y));
    let image = loaded.scene.materials[mesh.material(t as u32) as usize].texture.expect("it is textured").image;
    loaded.scene.textures[image as usize].sample(a * (1.0 - u - v) + b * u + c * v)
}

#[test]
fn pictures_stand_upright_and_are_taken_for_srgb() {
    let folder = Folder::new(&[("a.obj", PICTURE)]);
    folder.image("images/p.png");
    let object = "[[object]]\nmesh = 'a.obj'\nmaterial = 'm'";
    folder.write("a.toml", format!("tison = 1\n[material.m]\ntexture = 'images/p.png'\n{object}"));
    folder.write("b.ray", "Material \"m\" \"texture_albedo\" \"images/p.png\" \"k_diffuse\" 1 Mesh \"a.obj\" \"m\"");
    let (toml, ray) = (folder.good("a.toml"), folder.good("b.ray"));
    assert_eq!(seen(&toml, 0.25, 0.75), Vec3::X);
    assert_eq!(seen(&toml, 0.75, 0.75), Vec3::Y);
    let grey = tison::math::colour::linear(128.0 / 255.0) as f32;
    assert_eq!(seen(&toml, 0.25, 0.25), Vec3::splat(grey));
    assert!(!toml.scene.textures[0].nearest);
    // The course counts v downwards, and takes bytes as they are.
    assert_eq!(seen(&ray, 0.25, 0.25), Vec3::X);
    assert_eq!(seen(&ray, 0.25, 0.75), Vec3::splat(128.0 / 255.0));
    assert!(ray.scene.textures[0].nearest && ray.scene.course_rules);
    assert_eq!(ray.scene.background, Vec3::ZERO);
    // So does the same scene in TOML.
    folder.write("c.toml", format!("tison = 1\n[render]\ncourse_rules = true\n[material.m]\ntexture = 'images/p.png'\ntexture_filter = 'nearest'\n{object}"));
    assert_eq!(seen(&folder.good("c.toml"), 0.25, 0.25), Vec3::X);
    assert!(toml.texture_seconds > 0.0);
}

#[test]
fn an_image_is_read_once_for_each_way_to_look_it_up() {
    let folder = Folder::new(&[("sub/x", "")]);
    folder.image("p.png");
    folder.write(
        "a.json",
        r#"{"tison": 1, "material": {"a": {"texture": "p.png"}, "b": {"texture": "sub/../p.png", "color": 0.5},
        "c": {"texture": "p.png", "texture_filter": "nearest"}}, "object": [{"shape": "quad", "material": "a"},
        {"shape": "quad", "material": "b"}, {"shape": "quad", "material": "c"}]}"#,
    );
    let scene = folder.good("a.json").scene;
    let images: Vec<_> = scene.materials.iter().map(|m| m.texture.expect("it is textured").image).collect();
    assert_eq!(images, [0, 0, 1]);
    assert_eq!(scene.textures.iter().map(|t| t.nearest).collect::<Vec<_>>(), [false, true]);
    assert_eq!(scene.materials[1].texture.expect("it is textured").diffuse, Vec3::splat(0.5));
}

#[test]
fn a_mesh_brings_its_own_materials_and_their_images() {
    let mtl = "newmtl wood\nKd 0.5 1 1\nmap_Kd -s 1 1 1 images/p.png\nnewmtl red\nKd 1 0 0\nnewmtl unused\nmap_Kd other.png\n";
    let text = format!("mtllib a.mtl\nusemtl wood\n{PICTURE}usemtl red\nf 1 2 3\n");
    let folder = Folder::new(&[("models/a.obj", &text), ("models/a.mtl", mtl)]);
    folder.image("models/images/p.png");
    let own = "[[object]]\nmesh = 'models/a.obj'\n";
    folder.write("a.toml", format!("tison = 1\n[material.blue]\n[[object]]\nshape = 'cube'\n{own}"));
    folder.write("b.toml", format!("tison = 1\n[material.blue]\n{own}{own}material = 'blue'\n"));
    let bare = folder.good("models/a.obj");
    let names = |l: &Loaded| l.scene.materials.iter().map(|m| m.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&bare), ["wood", "red"]);
    assert_eq!(bare.unused, Unused { materials: 1, textures: 1, lights: 0 });
    assert_eq!((seen(&bare, 0.25, 0.75), seen(&bare, 0.75, 0.75)), (Vec3::X, Vec3::Y));
    assert_eq!(bare.scene.materials[0].texture.expect("wood").diffuse, Vec3::new(0.5, 1.0, 1.0));
    assert_eq!((bare.scene.materials[0].diffuse, bare.scene.materials[1].texture), (Vec3::ZERO, None));
    let told: Vec<_> = bare.warnings.iter().map(|w| w.what.as_str()).collect();
    assert_eq!(told, ["the options of 'map_Kd' have no effect here"]);
    // After those of the scene file.
    let loaded = folder.good("a.toml");
    assert_eq!(names(&loaded), ["default", "wood", "red"]);
    assert_eq!(mesh(&loaded, 1).paint, MeshPaint::PerFace(1));
    assert_eq!([0, 1, 2].map(|t| mesh(&loaded, 1).material(t)), [1, 1, 2]);
    assert_eq!(loaded.unused, Unused { materials: 2, textures: 1, lights: 0 });
    let loaded = folder.good("b.toml");
    assert_eq!(names(&loaded), ["blue", "wood", "red"]);
    assert_eq!((mesh(&loaded, 0).paint, mesh(&loaded, 1).paint), (MeshPaint::PerFace(1), MeshPaint::One(0)));
    assert!(mesh(&loaded, 0).data.uvs.is_some());
}

#[test]
fn images_of_a_library_that_cannot_be_used_are_warnings() {
    let mtl = "newmtl a\nmap_Kd gone.png\nnewmtl b\nmap_Kd broken.png\nnewmtl c\nmap_Kd gone too.png\n";
    let text = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}usemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n");
    let folder = Folder::new(&[("a.obj", &text), ("a.mtl", mtl), ("broken.png", "\u{89}PNG")]);
    let loaded = folder.good("a.obj");
    let told: Vec<_> =
        loaded.warnings.iter().map(|w| w.to_string().replace(&format!("{}", folder.path("").display()), "")).collect();
    assert_eq!(
        told,
        [
            "a.mtl:2: image 'gone.png' is not there: Kd is used alone (and 1 more like it)",
            "a.obj: it has no texture coordinates: the images of its materials are not shown",
            "broken.png: the image is no PNG, JPEG, BMP, HDR or PNM image; Kd is used alone",
        ]
    );
    assert!(loaded.scene.materials.iter().all(|m| m.texture.is_none() && m.diffuse == Material::default().diffuse));
}

#[test]
fn images_outside_the_folder_of_the_mesh_need_permission() {
    let mtl = "newmtl a\nmap_Kd ../images/p.png\n";
    let text = format!("mtllib a.mtl\nusemtl a\n{PICTURE}");
    let folder = Folder::new(&[("models/a.obj", &text), ("models/a.mtl", mtl)]);
    folder.image("images/p.png");
    let said = folder.bad("models/a.obj");
    assert_eq!(
        said,
        "models/a.mtl:2: images/p.png is outside the folder of the mesh that needs it and is not read; copy it into \
         that folder and name it there, or allow its folder with --allow-path images"
    );
    let allowed = folder.load_with("models/a.obj", |o| o.allow = vec![folder.path("images")]).expect("allowed");
    assert_eq!(allowed.scene.textures.len(), 1);
}
