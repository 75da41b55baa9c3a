//! What a release consists of: one version everywhere, and an archive that installs below a prefix.

mod util;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use util::Bench;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn check_release(project: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(project.join("dist/check-release"));
    command.args(arguments).env_remove("GITHUB_REPOSITORY").output().unwrap()
}

/// A copy of the files that state the version, and of the scripts.
fn copy_of_versions(bench: &Bench) {
    for file in [
        "dist/check-release",
        "dist/notes",
        "Cargo.toml",
        "Cargo.lock",
        "clients/python/Cargo.toml",
        "clients/python/Cargo.lock",
        "fuzz/Cargo.lock",
        "integrations/ros2_control/package.xml",
        "docs/install.md",
        "CHANGELOG.md",
    ] {
        let to = bench.path(file);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(root().join(file), to).unwrap();
    }
}

#[test]
fn one_version_stands_everywhere() {
    let output = check_release(root(), &[]);
    assert!(output.status.success(), "{}", util::stderr(&output));
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(said.trim_end(), concat!(env!("CARGO_PKG_VERSION"), " everywhere"));
}

#[test]
fn a_version_that_was_forgotten_is_named() {
    let version = env!("CARGO_PKG_VERSION");
    for (file, before) in [
        ("Cargo.toml", "\nversion = \""),
        ("Cargo.lock", "name = \"learner\"\nversion = \""),
        ("fuzz/Cargo.lock", "name = \"search\"\nversion = \""),
        ("clients/python/Cargo.toml", "\nversion = \""),
        ("clients/python/Cargo.lock", "name = \"skillet-robot\"\nversion = \""),
        ("integrations/ros2_control/package.xml", "<version>"),
    ] {
        let bench = Bench::new();
        copy_of_versions(&bench);
        let text = util::text(&bench.path(file));
        let changed = text.replacen(&format!("{before}{version}"), &format!("{before}9.9.9"), 1);
        assert_ne!(changed, text, "{file} states no version there");
        bench.write(file, &changed);
        let output = check_release(&bench.path("."), &[]);
        assert_eq!(output.status.code(), Some(1), "{file}");
        assert!(util::stderr(&output).contains(file), "{file}: {}", util::stderr(&output));
    }
}

#[test]
fn a_tag_needs_its_version_and_its_section_of_the_changelog() {
    let bench = Bench::new();
    copy_of_versions(&bench);
    let version = env!("CARGO_PKG_VERSION");
    let heading = format!("## {version}");
    bench.write("docs/install.md", "");
    bench.write("CHANGELOG.md", "# Changelog\n\n## Unreleased\n");
    let refused = check_release(&bench.path("."), &["v9.9.9"]);
    assert_eq!(refused.status.code(), Some(1));
    for words in ["the tag is v9.9.9", heading.as_str()] {
        assert!(util::stderr(&refused).contains(words), "{}", util::stderr(&refused));
    }
    let changes = format!("# Changelog\n\n## Unreleased\n\n{heading} (today)\n\n- New.\n");
    bench.write("CHANGELOG.md", &changes);
    let output = check_release(&bench.path("."), &[&format!("v{version}")]);
    assert!(output.status.success(), "{}", util::stderr(&output));
    let notes = Command::new(bench.path("dist/notes")).arg(version).output().unwrap();
    assert_eq!(String::from_utf8(notes.stdout).unwrap().trim(), "- New.");
}

/// The archive of this build, unpacked as people do it.
#[test]
fn the_archive_installs_below_a_prefix() {
    let bench = Bench::new();
    let run = |command: &mut Command| {
        let output = command.output().unwrap();
        assert!(output.status.success(), "{command:?}: {}", util::stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    let target = "x86_64-unknown-linux-gnu";
    let mut package = Command::new(root().join("dist/package"));
    package.arg(env!("CARGO_BIN_EXE_skillet")).arg(target).arg(bench.path("packages"));
    let archive = run(&mut package);
    let name = format!("skillet-{}-{target}", env!("CARGO_PKG_VERSION"));
    assert!(archive.trim_end().ends_with(&format!("packages/{name}.tar.gz")), "{archive}");

    let prefix = bench.path("prefix");
    fs::create_dir(&prefix).unwrap();
    let mut unpack = Command::new("tar");
    unpack.args(["--strip-components=1", "-xzf", archive.trim_end(), "-C"]).arg(&prefix);
    run(&mut unpack);

    let version = run(Command::new(prefix.join("bin/skillet")).arg("--version"));
    assert_eq!(version.trim_end(), concat!("skillet ", env!("CARGO_PKG_VERSION")));
    // Relative paths inside a ready configuration still lead to its demonstration.
    let config = prefix.join("share/skillet/config/pancake-panda.toml");
    bench.ok(&["config", "--config", config.to_str().unwrap()]);
    for (file, words) in [
        ("lib/systemd/system/skillet-controller@.service", "ExecStart=skillet controller"),
        ("lib/systemd/system/skillet-learner@.service", "ExecStart=skillet learner"),
        ("share/man/man1/skillet.1", ".TH"),
        ("share/man/man1/skillet-policy-activate.1", ".TH"),
        ("share/bash-completion/completions/skillet", "_skillet"),
        ("share/zsh/site-functions/_skillet", "#compdef skillet"),
        ("share/fish/vendor_completions.d/skillet.fish", "--command skillet"),
        ("share/doc/skillet/LICENSE-MIT", "MIT License"),
        ("share/doc/skillet/LICENSE-APACHE", "Apache License"),
        ("share/doc/skillet/LICENSE-THIRD-PARTY", "\niceoryx2 "),
        ("share/doc/skillet/LICENSE-THIRD-PARTY", "three.js authors"),
        ("share/skillet/layouts/foxglove.json", "3D!skillet"),
        ("share/skillet/layouts/plotjuggler.xml", "/tick/pose_m_rad[0]"),
    ] {
        assert!(util::text(&prefix.join(file)).contains(words), "{file}: no {words}");
    }
}
