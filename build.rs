//! Hands the release of the Embree headers on to `--version`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Stated by embree4-sys through `links`; absent without the feature.
    let embree = std::env::var("DEP_EMBREE4_VERSION").unwrap_or_default();
    println!("cargo::rustc-env=TISON_EMBREE={embree}");
}
