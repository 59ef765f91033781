# The recipes of the workshop; `just` lists them.

_default:
    @just --list

# All that CI checks: format, lints, docs, tests.
check:
    bash .ci/run

# Format the code.
fmt:
    cargo fmt --all

# Run the tests; e.g. `just test compare`.
test *filter:
    cargo test --workspace {{filter}}

# The command, built for speed; e.g. `just run compare truck --trees kd,wn+kd:6`.
run *arguments:
    cargo run --release -- {{arguments}}

# The documentation of all crates, in the browser.
doc:
    cargo doc --workspace --no-deps --open

# How many instructions builds and queries take, held against those on record; needs valgrind.
# `just instructions --record` records them.
instructions *arguments:
    cargo bench -p splitplane --bench instructions -- {{arguments}}

# Our queries beside Embree's and others'; e.g. `just peers killeroo --contenders embree,wn+kd:6`.
peers *arguments:
    cargo run --release --manifest-path crates/peers/Cargo.toml -- {{arguments}}

# Format and lint the peers' bench and the fuzz targets, which CI does not build.
check-apart:
    cargo fmt --manifest-path crates/peers/Cargo.toml --check
    cargo clippy --manifest-path crates/peers/Cargo.toml --all-targets -- -D warnings
    cargo fmt --manifest-path fuzz/Cargo.toml --check
    cargo clippy --manifest-path fuzz/Cargo.toml --all-targets -- -D warnings

# Fuzz one target (`just fuzz ply`) or all in turn, so many seconds each; needs cargo-fuzz.
fuzz target="pbrt_text pbrt_scene ply obj stl texture build_and_cast saved_tree" seconds="3600":
    for target in {{target}}; do \
        RUSTC_BOOTSTRAP=1 cargo fuzz run --sanitizer none "$target" -- \
            -max_total_time={{seconds}} -timeout=20 -rss_limit_mb=4096 || exit 1; \
    done

# Ask all trees many rays, and run the property tests with so many times their cases: hours.
soak rays="1e8" times="300":
    cargo run --release -- verify --rays {{rays}}
    cargo run --release -- verify --rays {{rays}} --preset thesis
    SPLITPLANE_SOAK={{times}} cargo test --release -p splitplane --lib
    cargo test --release -p splitplane --test bad_geometry -- --ignored

# The library's `unsafe` under Miri, which takes long; needs a nightly Rust with the components miri and rust-src.
miri:
    MIRIFLAGS="-Zmiri-tree-borrows -Zmiri-permissive-provenance -Zmiri-ignore-leaks" \
        cargo +nightly miri test -p splitplane --test small

# The rays of `verify` through other libraries as well, as the table in docs/verify.md.
leaks rays="100000" *arguments:
    cargo run --release --manifest-path crates/peers/Cargo.toml -- --leaks {{rays}} {{arguments}}

# Advisories and licences of the dependencies; needs cargo-deny.
deny:
    cargo deny check

# Licence texts of all that is linked in, for the wheel and the pages; needs cargo-about.
licences:
    cargo about generate --workspace --offline --fail about.hbs --output-file docs/licences.md

# What a batch costs from Python beside the same batch in Rust; `env` has the package installed.
overhead *arguments:
    cargo build --release -p splitplane --example batch
    python crates/splitplane-py/benches/overhead.py {{arguments}}
