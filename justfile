# Short names for what CI and people run; `just --list` shows them.

# Everything CI checks
check:
    .ci/run

# The main job
learn *args:
    cargo run --release -- learn pancake {{args}}

# Format and lint with fixes
fix:
    cargo fmt --all
    cargo clippy --workspace --all-targets --fix --allow-dirty

# The bridge to other machines, which no other command builds
bridge:
    cargo clippy -p bridge --all-targets --features network --locked -- -D warnings
    cargo test -p bridge --features network --locked
    cargo test --features bridge --locked --test ros2_live --test soak_across
