#!/usr/bin/env bash
# All tests: the renderer with Embree, the bindings' layout and the other crate in sys/, and the renderer without Embree.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --locked
cargo test --locked -p embree4-sys -p tison-pages
cargo test --locked --no-default-features
