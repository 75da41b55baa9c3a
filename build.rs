//! Tells the tool of which commit it was built: a page of results is to name it. Only for release builds, so that a
//! commit does not rebuild what is being worked on; `SKILLET_COMMIT` says it where there is no repository.

use std::process::Command;

fn main() {
    println!("cargo:rerun-if-env-changed=SKILLET_COMMIT");
    let given = std::env::var("SKILLET_COMMIT").ok();
    let is_release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let commit = given.or_else(|| is_release.then(of_repository).flatten());
    if let Some(commit) = commit {
        println!("cargo:rustc-env=SKILLET_BUILT_FROM={commit}");
    }
}

/// The commit that is checked out, marked where files differ from it.
fn of_repository() -> Option<String> {
    let head = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    println!("cargo:rerun-if-changed={head}");
    git(&["describe", "--always", "--dirty", "--abbrev=10", "--exclude", "*"])
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty()).then_some(text)
}
