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
