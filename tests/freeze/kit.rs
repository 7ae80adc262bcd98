//! Folders with scenes in them, and what becomes of those.

use glam::{DAffine3, DMat3, DVec3};
use image::{Rgb, RgbImage};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use tison::geom::BAD_FACE;
use tison::scene::format::Look;
use tison::scene::{Error, LoadOptions, Loaded, Mesh, Object, load};

/// A folder with a scene in it.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new(files: &[(&str, &str)]) -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder for the test"));
        for (name, text) in files {
            folder.write(name, text);
        }
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().canonicalize().expect("it is there").join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("it has one")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }

    /// An image with a red texel at the top left, green at the top right, and grey below.
    pub fn image(&self, name: &str) {
        let pixel = |x, y| [Rgb([255, 0, 0]), Rgb([0, 255, 0]), Rgb([128; 3]), Rgb([128; 3])][(2 * y + x) as usize];
        std::fs::create_dir_all(self.path(name).parent().expect("it has one")).expect("a folder");
        RgbImage::from_fn(2, 2, pixel).save(self.path(name)).expect("the image can be written");
    }

    pub fn load_with(&self, name: &str, change: impl FnOnce(&mut LoadOptions<'_>)) -> Result<Loaded, Error> {
        static GO_ON: AtomicBool = AtomicBool::new(false);
        let mut options = LoadOptions::new(&GO_ON);
        change(&mut options);
        load(&self.path(name), &options)
    }

    pub fn good(&self, name: &str) -> Loaded {
        self.load_with(name, |_| {}).unwrap_or_else(|e| panic!("{}", self.shown(&e)))
    }

    /// What is wrong with it, as a user sees it.
    pub fn bad(&self, name: &str) -> String {
        self.shown(&self.load_with(name, |_| {}).expect_err("it must be refused"))
    }

    pub fn shown(&self, e: &Error) -> String {
        let text = match e {
            Error::Scene(list) => list.iter().map(|d| d.render(Look::Plain) + "\n").collect(),
            e => e.to_string(),
        };
        text.replace(&format!("{}", self.path("").display()), "")
    }
}

/// A folder with `a.toml` in it, which needs no version and lights of its own, and other files.
pub fn scene(text: &str, files: &[(&str, &str)]) -> Loaded {
    let folder = Folder::new(files);
    folder.write("a.toml", format!("tison = 1\n{text}"));
    folder.good("a.toml")
}

pub const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
/// A box with a corner at the origin, outward normals, texture coordinates on one face, and a vertex far off.
pub const BOX: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 4\nv 2 0 4\nv 2 1 4\nv 0 1 4\nv 90 90 90\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 -1\nvn 0 0 1\nvn 0 -1 0\nvn 0 1 0\nvn -1 0 0\nvn 1 0 0\n\
    f 4//1 3//1 2//1 1//1\nf 5/1/2 6/2/2 7/3/2 8/4/2\nf 1//3 2//3 6//3 5//3\nf 3//4 4//4 8//4 7//4\n\
    f 4//5 1//5 5//5 8//5\nf 2//6 3//6 7//6 6//6\n";

pub fn mesh(loaded: &Loaded, object: usize) -> &Mesh {
    loaded.scene.objects[object].mesh().expect("it is a mesh")
}

/// World positions of the corners of every triangle of an object that is a mesh.
pub fn corners(loaded: &Loaded, object: usize) -> Vec<DVec3> {
    let object = &loaded.scene.objects[object];
    let triangles = &object.mesh().expect("it is a mesh").data.triangles;
    let to_scene = match object {
        Object::Instance(i) => i.to_scene,
        _ => DAffine3::IDENTITY,
    };
    let good = triangles.faces().iter().filter(|&&f| f != BAD_FACE).flatten();
    let to_world = |i: &u32| loaded.scene.frame.to_world(to_scene.transform_point3(triangles.point(*i).as_dvec3()));
    good.map(to_world).collect()
}

/// Scene-space normals at the corners of every triangle, of unit length.
pub fn normals(loaded: &Loaded, object: usize) -> Vec<DVec3> {
    let object = &loaded.scene.objects[object];
    let data = &object.mesh().expect("it is a mesh").data;
    let matrix = match object {
        Object::Instance(i) => i.normal_to_scene,
        _ => DMat3::IDENTITY,
    };
    let of = data.normals.as_ref().expect("it has normals");
    let numbers = (0..data.triangles.face_count()).map(|t| of.of(data.triangles.faces(), t));
    let three = numbers.flat_map(|n| of.three::<3>(n).expect("all corners have one"));
    three.map(|n| (matrix * DVec3::from(n.map(f64::from))).normalize()).collect()
}

#[track_caller]
pub fn near(got: DVec3, want: DVec3, tolerance: f64) {
    assert!((got - want).length() <= tolerance, "{got} is not {want}");
}
