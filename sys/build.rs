//! Binds the Embree headers that are installed here, never a vendored copy.
//!
//! What is missing is looked for first, so that its absence is one sentence that says what to do: bindgen and
//! cc would answer with a backtrace or pages of compiler output.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// First release whose `RTCHit` has the fields that `tison` hands over.
const OLDEST: [u32; 3] = [4, 3, 0];

/// Works on Debian and Ubuntu; the last part works everywhere.
const INSTALL: &str = "run ./sys/setup.sh (or `apt-get install libembree-dev libclang-dev`), \
                       or build without Embree: cargo build --no-default-features";

fn main() {
    if let Err(sentence) = bind() {
        // Cargo fails the build after this line, without the output of the script or a backtrace.
        println!("cargo::error={sentence}");
    }
}

fn bind() -> Result<(), String> {
    for file in ["build.rs", "wrapper.h", "csrc/shim.c", "csrc/layout.c"] {
        println!("cargo::rerun-if-changed={file}");
    }
    for variable in ["EMBREE_DIR", "LIBCLANG_PATH", "LLVM_CONFIG_PATH", "BINDGEN_EXTRA_CLANG_ARGS"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    let embree = Embree::find()?;
    let version = header_version(&embree.include)?;
    println!("cargo::rerun-if-changed={}", embree.include.join("embree4/rtcore_config.h").display());
    clang_sys::load().map_err(|_| format!("libclang, which reads Embree's header, is missing: {INSTALL}"))?;
    write_bindings(&embree.include)?;
    compile(&embree.include)?;

    if let Some(dir) = &embree.lib {
        println!("cargo::rustc-link-search=native={}", dir.display());
        // For the tests of this crate; who links a binary reads `lib_dir` and does the same.
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", dir.display());
        println!("cargo::metadata=lib_dir={}", dir.display());
    }
    println!("cargo::rustc-link-lib=dylib=embree4");
    println!("cargo::metadata=version={}", version.map(|n| n.to_string()).join("."));
    Ok(())
}

/// Where the header and, when it is not on the linker's own path, the library are.
struct Embree {
    include: PathBuf,
    lib: Option<PathBuf>,
}

impl Embree {
    /// `EMBREE_DIR` if it is set, else what pkg-config knows, else the places that compilers search.
    fn find() -> Result<Self, String> {
        if let Some(prefix) = env::var_os("EMBREE_DIR").filter(|p| !p.is_empty()) {
            return Self::in_prefix(&PathBuf::from(prefix));
        }
        if let Ok(found) = pkg_config::Config::new().cargo_metadata(false).atleast_version("4").probe("embree") {
            let include = found.include_paths.into_iter().chain(searched_by_compilers()).find(|dir| has_header(dir));
            if let Some(include) = include {
                return Ok(Self { include, lib: found.link_paths.into_iter().next() });
            }
        }
        match searched_by_compilers().find(|dir| has_header(dir)) {
            Some(include) => Ok(Self { include, lib: None }),
            None if searched_by_compilers().any(|dir| dir.join("embree3").is_dir()) => {
                Err(format!("Embree 3 is installed, but Embree 4 is needed: {INSTALL}"))
            }
            None => Err(format!("the headers of Embree 4 are missing: {INSTALL}; or set EMBREE_DIR to its prefix")),
        }
    }

    fn in_prefix(prefix: &Path) -> Result<Self, String> {
        let include = prefix.join("include");
        if !has_header(&include) {
            return Err(format!(
                "there is no include/embree4/rtcore.h in EMBREE_DIR ({}): set it to the prefix of an Embree 4, \
                 or unset it to use the installed one",
                prefix.display()
            ));
        }
        let lib = ["lib", "lib64", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"].map(|dir| prefix.join(dir));
        let lib = lib.into_iter().find(|dir| has_library(dir)).ok_or_else(|| {
            format!("there is no libembree4 in the lib directory of EMBREE_DIR ({})", prefix.display())
        })?;
        Ok(Self { include, lib: Some(lib) })
    }
}

fn searched_by_compilers() -> impl Iterator<Item = PathBuf> {
    let from_env = ["CPATH", "C_INCLUDE_PATH"].into_iter().filter_map(env::var_os);
    let from_env: Vec<PathBuf> = from_env.flat_map(|paths| env::split_paths(&paths).collect::<Vec<_>>()).collect();
    let usual = ["/usr/local/include", "/usr/include", "/opt/homebrew/include"].map(PathBuf::from);
    from_env.into_iter().chain(usual)
}

fn has_header(include: &Path) -> bool {
    include.join("embree4/rtcore.h").is_file()
}

fn has_library(dir: &Path) -> bool {
    ["libembree4.so", "libembree4.dylib", "embree4.lib"].iter().any(|name| dir.join(name).exists())
}

/// Release of the header in `include`, which must not be older than [`OLDEST`].
fn header_version(include: &Path) -> Result<[u32; 3], String> {
    let path = include.join("embree4/rtcore_config.h");
    let text = fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    let number = |name: &str| {
        let mut words = text.lines().map(str::split_ascii_whitespace);
        words.find_map(|mut w| {
            (w.next() == Some("#define") && w.next() == Some(name)).then(|| w.next()?.parse().ok())?
        })
    };
    let version = match ["RTC_VERSION_MAJOR", "RTC_VERSION_MINOR", "RTC_VERSION_PATCH"].map(number) {
        [Some(major), Some(minor), Some(patch)] => [major, minor, patch],
        _ => return Err(format!("{} does not say which release it is of", path.display())),
    };
    if version < OLDEST || version[0] > 4 {
        let [major, minor, patch] = version;
        return Err(format!(
            "{} is of Embree {major}.{minor}.{patch}, but Embree 4 from 4.3 on is needed: {INSTALL}",
            path.display()
        ));
    }
    Ok(version)
}

fn write_bindings(include: &Path) -> Result<(), String> {
    let bindings = bindgen::builder()
        .header("wrapper.h")
        .clang_arg(format!("-I{}", include.display()))
        .allowlist_function("(rtc[A-Z]|embree4_).*")
        .allowlist_type("RTC.*")
        .allowlist_var("RTC_.*")
        // Inline functions have no symbol but for those of csrc/shim.c.
        .generate_inline_functions(true)
        .blocklist_function("rtc(Interpolate[012]|.*QuaternionDecomposition.*|DefaultBuildArguments)")
        // C may hand over a value that this header does not list: never a Rust `enum`.
        .bitfield_enum("RTC.*Flags")
        .newtype_enum("RTC.*")
        // An all-zero RTCHit claims a hit on geometry 0: no `Default`.
        .derive_default(false)
        .generate_comments(false)
        .use_core()
        .rust_target(bindgen::RustTarget::stable(89, 0).map_err(|e| e.to_string())?)
        .rust_edition(bindgen::RustEdition::Edition2024)
        .generate()
        .map_err(|e| {
            let reason = e.to_string();
            let reason = reason.lines().next().unwrap_or_default();
            format!("libclang cannot read {}/embree4/rtcore.h ({reason}): {INSTALL}", include.display())
        })?;
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set: run this by cargo")?);
    bindings.write_to_file(out.join("bindings.rs")).map_err(|e| format!("cannot write the bindings: {e}"))
}

fn compile(include: &Path) -> Result<(), String> {
    cc::Build::new()
        .files(["csrc/shim.c", "csrc/layout.c"])
        .include(include)
        .std("c11")
        .cargo_warnings(false)
        .try_compile("embree4_shim")
        .map_err(|e| {
            let reason = e.to_string();
            let reason = reason.lines().next().unwrap_or_default();
            format!("the C compiler failed ({reason}): {INSTALL}")
        })
}
